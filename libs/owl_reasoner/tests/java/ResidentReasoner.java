// A Java reasoner that stays in its JVM and takes commands on standard input, one a line, fields separated by
// tabs; it answers with one line each. Run from source: java -cp <jars> ResidentReasoner.java pellet|hermit
//
//   load PATH                      -> ok | inconsistent | error MESSAGE
//   class C X                      -> true | false        (by refutation)
//   object P X Y, data P X LEXICAL DATATYPE, same X Y, different X Y, subclass C D
//   below C, members C             -> the named subclasses (individuals), separated by tabs
//   all N                          -> for each of the N questions on the next lines a letter: t, f, or e for an error
//   visit ROBOT FROM TO NOW_OLD NOW_NEW VISIT_OLD VISIT_NEW
//                                  -> NANOSECONDS of replacing and checking consistency, NANOSECONDS of the queries

import com.clarkparsia.pellet.owlapiv3.PelletReasonerFactory;
import java.io.BufferedReader;
import java.io.File;
import java.io.InputStreamReader;
import java.util.ArrayList;
import java.util.List;
import org.semanticweb.owlapi.apibinding.OWLManager;
import org.semanticweb.owlapi.model.*;
import org.semanticweb.owlapi.reasoner.OWLReasoner;

public class ResidentReasoner {
    static final String BASE = "http://bnc/exp-rob-lab/2022-23#";
    static final String LONG = "http://www.w3.org/2001/XMLSchema#long";
    final String kind;
    OWLOntologyManager manager;
    OWLDataFactory factory;
    OWLOntology ontology;
    OWLReasoner reasoner;

    ResidentReasoner(String kind) {
        this.kind = kind;
    }

    public static void main(String[] arguments) throws Exception {
        java.io.PrintStream out = System.out;
        System.setOut(System.err);
        ResidentReasoner resident = new ResidentReasoner(arguments[0]);
        BufferedReader in = new BufferedReader(new InputStreamReader(System.in, "UTF-8"));
        for (String line = in.readLine(); line != null; line = in.readLine()) {
            String answer;
            try {
                String[] words = line.split("\t");
                answer = words[0].equals("all") ? resident.all(in, Integer.parseInt(words[1])) : resident.answer(words);
            } catch (Throwable error) {
                answer = "error " + (error.getClass().getName() + ": " + error.getMessage()).replaceAll("\\s+", " ");
            }
            out.println(answer);
            out.flush();
        }
    }

    String all(BufferedReader in, int number) throws Exception {
        StringBuilder letters = new StringBuilder();
        for (int question = 0; question < number; question++) {
            String[] words = in.readLine().split("\t", -1);
            try {
                letters.append(reasoner.isEntailed(axiom(words)) ? 't' : 'f');
            } catch (Throwable error) {
                letters.append('e');
            }
        }
        return letters.toString();
    }

    String answer(String[] words) throws Exception {
        if (words[0].equals("load")) {
            return load(words[1]);
        }
        if (words[0].equals("visit")) {
            return visit(words);
        }
        if (words[0].equals("below") || words[0].equals("members")) {
            OWLClass cls = factory.getOWLClass(IRI.create(words[1]));
            StringBuilder names = new StringBuilder("-");
            for (OWLEntity found : words[0].equals("below")
                    ? reasoner.getSubClasses(cls, false).getFlattened()
                    : reasoner.getInstances(cls, false).getFlattened()) {
                names.append("\t").append(found.getIRI());
            }
            if (words[0].equals("below")) {
                for (OWLClass equal : reasoner.getEquivalentClasses(cls).getEntities()) {
                    names.append("\t").append(equal.getIRI());
                }
            }
            return names.toString();
        }
        return String.valueOf(reasoner.isEntailed(axiom(words)));
    }

    String load(String path) throws Exception {
        if (reasoner != null) {
            reasoner.dispose();
        }
        manager = OWLManager.createOWLOntologyManager();
        factory = manager.getOWLDataFactory();
        ontology = manager.loadOntologyFromOntologyDocument(new File(path));
        if (kind.equals("pellet")) {
            reasoner = PelletReasonerFactory.getInstance().createNonBufferingReasoner(ontology);
        } else {
            reasoner = new org.semanticweb.HermiT.Reasoner.ReasonerFactory().createReasoner(ontology);
        }
        return reasoner.isConsistent() ? "ok" : "inconsistent";
    }

    OWLNamedIndividual individual(String iri) {
        return factory.getOWLNamedIndividual(IRI.create(iri));
    }

    OWLObjectProperty property(String iri) {
        return factory.getOWLObjectProperty(IRI.create(iri));
    }

    OWLDataProperty data(String iri) {
        return factory.getOWLDataProperty(IRI.create(iri));
    }

    OWLAxiom value(String property, String individual, String lexical, String datatype) {
        // A file's strings come in as plain literals.
        OWLLiteral literal = datatype.endsWith("#string")
            ? factory.getOWLLiteral(lexical, "")
            : factory.getOWLLiteral(lexical, factory.getOWLDatatype(IRI.create(datatype)));
        return factory.getOWLDataPropertyAssertionAxiom(data(property), individual(individual), literal);
    }

    OWLAxiom axiom(String[] words) {
        switch (words[0]) {
            case "class":
                return factory.getOWLClassAssertionAxiom(
                    factory.getOWLClass(IRI.create(words[1])), individual(words[2]));
            case "object":
                return factory.getOWLObjectPropertyAssertionAxiom(
                    property(words[1]), individual(words[2]), individual(words[3]));
            case "data":
                return value(words[1], words[2], words[3], words[4]);
            case "same":
                return factory.getOWLSameIndividualAxiom(individual(words[1]), individual(words[2]));
            case "different":
                return factory.getOWLDifferentIndividualsAxiom(individual(words[1]), individual(words[2]));
            case "subclass":
                return factory.getOWLSubClassOfAxiom(
                    factory.getOWLClass(IRI.create(words[1])), factory.getOWLClass(IRI.create(words[2])));
            default:
                throw new IllegalArgumentException("unknown command " + words[0]);
        }
    }

    String visit(String[] words) {
        String robot = words[1];
        List<OWLOntologyChange> changes = new ArrayList<OWLOntologyChange>();
        OWLAxiom from = factory.getOWLObjectPropertyAssertionAxiom(
            property(BASE + "isIn"), individual(robot), individual(words[2]));
        OWLAxiom to = factory.getOWLObjectPropertyAssertionAxiom(
            property(BASE + "isIn"), individual(robot), individual(words[3]));
        changes.add(new RemoveAxiom(ontology, from));
        changes.add(new AddAxiom(ontology, to));
        changes.add(new RemoveAxiom(ontology, value(BASE + "now", robot, words[4], LONG)));
        changes.add(new AddAxiom(ontology, value(BASE + "now", robot, words[5], LONG)));
        changes.add(new RemoveAxiom(ontology, value(BASE + "visitedAt", words[3], words[6], LONG)));
        changes.add(new AddAxiom(ontology, value(BASE + "visitedAt", words[3], words[7], LONG)));
        long start = System.nanoTime();
        manager.applyChanges(changes);
        reasoner.flush();
        reasoner.isConsistent();
        long reasoned = System.nanoTime();
        reasoner.getObjectPropertyValues(individual(robot), property(BASE + "canReach")).getFlattened();
        reasoner.getInstances(factory.getOWLClass(IRI.create(BASE + "URGENT")), false).getFlattened();
        reasoner.getInstances(factory.getOWLClass(IRI.create(BASE + "CORRIDOR")), false).getFlattened();
        reasoner.getObjectPropertyValues(individual(robot), property(BASE + "isIn")).getFlattened();
        long queried = System.nanoTime();
        return (reasoned - start) + " " + (queried - reasoned);
    }
}
