"""How long a university takes: reading and reasoning over LUBM's data.

    python benchmarks/lubm.py univ-bench.owl [--universities 1] [--java]

The ontology is the Lehigh University Benchmark's (Guo, Pan and Heflin, "LUBM: A Benchmark for OWL
Knowledge Base Systems", Journal of Web Semantics 3, 2005), a file that the user gives. The data are
drawn here by the numbers of its generator (departments, staff, students, courses, publications):
about 100,000 triples a university. The file is written and read as N-Triples and as RDF/XML. All
seconds are processor time; those of HermiT and Pellet include reading, and finding the members of
three classes.
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.sizes import Size, sized_parser
from libs.owl_reasoner.tests.java_reasoner import KINDS, JavaReasoner, JavaReasonerError, absent
from owl_reasoner import (
    KnowledgeBase,
    read_ontology,
    write_ontology,
)
from owl_reasoner.owl.axioms import (
    Axiom,
    ClassAssertion,
    DataPropertyAssertion,
    ObjectPropertyAssertion,
)
from owl_reasoner.owl.expressions import Literal

UB = 'http://swat.cse.lehigh.edu/onto/univ-bench.owl#'
STAFF = (('FullProfessor', 7, 10), ('AssociateProfessor', 10, 14), ('AssistantProfessor', 8, 11))
PAPERS = {'FullProfessor': 15, 'AssociateProfessor': 10, 'AssistantProfessor': 5, 'Lecturer': 0}


class University:
    """Draws one university.

    Args:
        number: Its number, which is the seed too.
    """

    def __init__(self, number: int) -> None:
        self._random = random.Random(number)
        self._home = f'http://www.University{number}.edu'
        self._courses: list[str] = []
        self._graduate: list[str] = []

    def axioms(self) -> Iterator[Axiom]:
        """Yield the assertions of 15 to 25 departments."""
        yield ClassAssertion(UB + 'University', self._home)
        for number in range(15 if self._home.endswith('y0.edu') else self._random.randint(15, 25)):
            yield from self._department(f'http://www.Department{number}.{self._home[11:]}')

    def _department(self, home: str) -> Iterator[Axiom]:
        draw = self._random
        self._courses, self._graduate = [], []
        yield ClassAssertion(UB + 'Department', home)
        yield self._link('subOrganizationOf', home, self._home)
        for number in range(draw.randint(10, 20)):
            group = f'{home}/ResearchGroup{number}'
            yield ClassAssertion(UB + 'ResearchGroup', group)
            yield self._link('subOrganizationOf', group, home)
        staff: list[str] = []
        for kind, least, most in (*STAFF, ('Lecturer', 5, 7)):
            for number in range(draw.randint(least, most)):
                person = f'{home}/{kind}{number}'
                staff.append(person)
                yield from self._teacher(kind, person, home)
        yield self._link('headOf', staff[0], home)
        professors = [person for person in staff if '/Lecturer' not in person]
        for number in range(len(staff) * draw.randint(8, 14)):
            yield from self._student(f'{home}/UndergraduateStudent{number}', home, professors)
        graduates = [f'{home}/GraduateStudent{n}' for n in range(len(staff) * draw.randint(3, 4))]
        for student in graduates:
            yield from self._graduate_student(student, home, professors)
        for person in professors:
            kind = person.rsplit('/', 1)[1].rstrip('0123456789')
            for number in range(draw.randint(PAPERS[kind], PAPERS[kind] + 5)):
                paper = f'{person}/Publication{number}'
                yield ClassAssertion(UB + 'Publication', paper)
                yield self._text('name', paper, f'Publication{number}')
                yield self._link('publicationAuthor', paper, person)
                for author in draw.sample(graduates, draw.randint(0, 3)):
                    yield self._link('publicationAuthor', paper, author)
        for student in draw.sample(graduates, len(graduates) // 4):
            yield ClassAssertion(UB + 'TeachingAssistant', student)
            yield self._link('teachingAssistantOf', student, draw.choice(self._courses))

    def _teacher(self, kind: str, person: str, home: str) -> Iterator[Axiom]:
        draw = self._random
        yield from self._person(kind, person)
        yield self._link('worksFor', person, home)
        for degree in ('undergraduate', 'masters', 'doctoral'):
            yield self._degree(degree, person)
        yield self._text('researchInterest', person, f'Research{draw.randrange(30)}')
        for table, name in ((self._courses, 'Course'), (self._graduate, 'GraduateCourse')):
            for _ in range(draw.randint(1, 2)):
                course = f'{home}/{name}{len(table)}'
                table.append(course)
                yield ClassAssertion(UB + name, course)
                yield self._text('name', course, course.rsplit('/', 1)[1])
                yield self._link('teacherOf', person, course)

    def _student(self, person: str, home: str, professors: list[str]) -> Iterator[Axiom]:
        draw = self._random
        yield from self._person('UndergraduateStudent', person)
        yield self._link('memberOf', person, home)
        for course in draw.sample(self._courses, draw.randint(2, 4)):
            yield self._link('takesCourse', person, course)
        if not draw.randrange(5):
            yield self._link('advisor', person, draw.choice(professors))

    def _graduate_student(self, person: str, home: str, professors: list[str]) -> Iterator[Axiom]:
        draw = self._random
        yield from self._person('GraduateStudent', person)
        yield self._link('memberOf', person, home)
        yield self._degree('undergraduate', person)
        yield self._link('advisor', person, draw.choice(professors))
        for course in draw.sample(self._graduate, draw.randint(1, 3)):
            yield self._link('takesCourse', person, course)

    def _person(self, kind: str, person: str) -> Iterator[Axiom]:
        name = person.rsplit('/', 1)[1]
        yield ClassAssertion(UB + kind, person)
        yield self._text('name', person, name)
        yield self._text('emailAddress', person, f'{name}@{person[7:].split("/")[0]}')
        yield self._text('telephone', person, 'xxx-xxx-xxxx')

    def _degree(self, degree: str, person: str) -> Axiom:
        home = f'http://www.University{self._random.randrange(1000)}.edu'
        return self._link(f'{degree}DegreeFrom', person, home)

    @staticmethod
    def _link(prop: str, one: str, other: str) -> Axiom:
        return ObjectPropertyAssertion(UB + prop, one, other)

    @staticmethod
    def _text(prop: str, one: str, text: str) -> Axiom:
        return DataPropertyAssertion(UB + prop, one, Literal(text))


def measure(path: Path) -> tuple[float, float, KnowledgeBase]:
    """Return (seconds to read, seconds to reason, what follows) of a file."""
    start = time.process_time()
    document = read_ontology(path, UB)
    read = time.process_time() - start
    start = time.process_time()
    kb = KnowledgeBase(UB, document.axioms)
    if not kb.reason():
        raise SystemExit(f'{path.name}: inconsistent: {kb.explain_inconsistency()}')
    return read, time.process_time() - start, kb


def main() -> None:
    """Read the arguments and print the table."""
    parser = sized_parser(__doc__)
    parser.add_argument('ontology', type=Path, nargs='?', help='univ-bench.owl')
    parser.add_argument('--universities', type=int, default=1)
    parser.add_argument(
        '--java',
        action='store_true',
        help='HermiT and Pellet beside it',
    )
    arguments = parser.parse_args()
    if arguments.size is Size.SMOKE:
        # A part of the data, without the schema, which is not in the checkout.
        axioms = list(islice(University(0).axioms(), 500))
    elif arguments.ontology is None:
        parser.error('the ontology univ-bench.owl is missing')
    else:
        axioms = list(read_ontology(arguments.ontology, UB).axioms)
        for number in range(arguments.universities):
            axioms += University(number).axioms()
    print(f'{len(axioms)} axioms')
    print(f'{"":12} {"read":>8} {"reason":>8} {"Student":>8} {"Person":>8} {"Chair":>6}  named')
    with tempfile.TemporaryDirectory() as folder:
        for ending, form in (('nt', 'ntriples'), ('owl', 'rdfxml')):
            path = Path(folder) / f'university.{ending}'
            write_ontology(axioms, UB, path, form)
            read, reason, kb = measure(path)
            counts = [len(kb.instances(UB + name)) for name in ('Student', 'Person', 'Chair')]
            line = f'{"here, ." + ending:12} {read:7.2f}s {reason:7.2f}s '
            print(line + '{:8} {:8} {:6}'.format(*counts), f' {len(kb.unsupported)}')
        for kind in KINDS if arguments.java and not absent() else ():
            try:
                with JavaReasoner(kind, timeout=600) as peer:
                    peer.ask('load', str(arguments.ontology))
                    before = peer.cpu_seconds()
                    peer.ask('load', str(path))
                    names = ('Student', 'Person', 'Chair')
                    counts = [peer.ask('members', UB + n).count('\t') for n in names]
                    seconds = peer.cpu_seconds() - before
                    print(
                        f'{kind + ", .owl":12} {"":8} {seconds:7.2f}s {{:8}} {{:8}} {{:6}}'.format(
                            *counts
                        )
                    )
            except JavaReasonerError as error:
                print(f'{kind + ", .owl":12} {error}')


if __name__ == '__main__':
    main()
