"""The directives about references, files and logging, and APPLY and REASON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from surveillance_ontology.armor.protocol import (
    DirectiveError,
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
)
from surveillance_ontology.armor.reference import Reference
from surveillance_ontology.armor.table import control, flag, text, utility

if TYPE_CHECKING:
    from surveillance_ontology.armor.service import ArmorService

_LOAD = (
    text('iri'),
    flag('buffered manipulation'),
    text('reasoner'),
    flag('buffered reasoner'),
)
_LOAD_SUMMARY = (
    'Loads an ontology under the reference name. With buffered manipulation changes wait until '
    'APPLY or REASON; with a buffered reasoner derived facts follow at REASON only. A name that is '
    'loaded already stays as it is, except for the first flag.'
)
_LOAD_DIFFERS = (
    'Only files in the allowed directories. A file that cannot be loaded leaves no reference '
    'behind. What the reasoner does not support is named in the description. Switching buffering '
    'off applies what waits.'
)
_WEB_DIFFERS = 'Refused unless the parameter allow_web is set.'


@utility('LOAD FILE', text('path'), *_LOAD, summary=_LOAD_SUMMARY, differs=_LOAD_DIFFERS, slow=True)
def _load_file(service: ArmorService, request: DirectiveRequest, *values: Any) -> DirectiveResponse:
    return service.load(request, *values)


@utility(
    'LOAD FILE MOUNTED',
    *(text('path'), *_LOAD),
    summary='LOAD FILE, then MOUNT. When mounting is refused the ontology stays loaded.',
    slow=True,
)
def _load_file_mounted(
    service: ArmorService, request: DirectiveRequest, *values: Any
) -> DirectiveResponse:
    response = service.load(request, *values)
    service.mount(request)
    return response


@utility(
    'LOAD WEB',
    *(text('url'), *_LOAD),
    summary='LOAD FILE with a document from the web.',
    differs=_WEB_DIFFERS,
    slow=True,
)
def _load_web(service: ArmorService, request: DirectiveRequest, *values: Any) -> DirectiveResponse:
    return service.load(request, *values, web=True)


@utility(
    'LOAD WEB MOUNTED',
    *(text('url'), *_LOAD),
    summary='LOAD WEB, then MOUNT.',
    differs=_WEB_DIFFERS,
    slow=True,
)
def _load_web_mounted(
    service: ArmorService, request: DirectiveRequest, *values: Any
) -> DirectiveResponse:
    response = service.load(request, *values, web=True)
    service.mount(request)
    return response


@utility('DROP', summary='Forgets the reference; success also when there is none.')
def _drop(service: ArmorService, request: DirectiveRequest) -> DirectiveResponse:
    service.drop(request.reference_name)
    return DirectiveResponse()


@utility(
    'SAVE',
    text('path', ''),
    summary='Writes the asserted axioms in the format that was loaded; an empty path stands for '
    'the file that was loaded.',
    differs='Written beside the file and renamed, so that a crash leaves the old file whole. '
    'Turtle is written as N-Triples, OWL/XML as RDF/XML; a path that ends in .nt gets N-Triples, '
    'which hold names that RDF/XML cannot.',
    slow=True,
)
def _save(service: ArmorService, request: DirectiveRequest, path: str) -> DirectiveResponse:
    service.save(request.reference_name, path, inferences=False)
    return DirectiveResponse()


@utility(
    'SAVE INFERENCE',
    text('path', ''),
    summary='SAVE with the derived facts.',
    differs='The live ontology stays as it is; ARMOR asserts every derived fact for good.',
    slow=True,
)
def _save_inference(
    service: ArmorService, request: DirectiveRequest, path: str
) -> DirectiveResponse:
    service.save(request.reference_name, path, inferences=True)
    return DirectiveResponse()


@utility(
    'MOUNT',
    summary='From now on only this client may change the ontology; 203 when another is mounted or '
    'the reference is unknown.',
    differs='Enforced, unless the parameter enforce_mount is off; ARMOR reports 102 and carries '
    'the manipulation out.',
)
def _mount(service: ArmorService, request: DirectiveRequest) -> DirectiveResponse:
    return service.mount(request)


@utility('UNMOUNT', summary='Ends MOUNT; a client that is not mounted changes nothing by it.')
def _unmount(service: ArmorService, request: DirectiveRequest) -> DirectiveResponse:
    return service.unmount(request)


@utility('GET ALL REFS', summary='The names of all references.')
def _get_all(service: ArmorService, _: DirectiveRequest) -> DirectiveResponse:
    return DirectiveResponse(queried_objects=service.references.names())


@utility(
    'GET REF CLIENT',
    text('reference'),
    summary='The client mounted on a reference, `none` when there is none.',
    differs='An unknown reference is answered with 205.',
)
def _get_client(service: ArmorService, _: DirectiveRequest, name: str) -> DirectiveResponse:
    return DirectiveResponse(queried_objects=[service.references.find(name).mounted])


@utility('LOG FILE ON', text('path'), summary='Appends each directive with its answer to a file.')
def _log_file_on(service: ArmorService, _: DirectiveRequest, path: str) -> DirectiveResponse:
    service.log.open(service.paths.to_write(path))
    return DirectiveResponse()


@utility('LOG FILE OFF', summary='Ends LOG FILE ON.')
def _log_file_off(service: ArmorService, _: DirectiveRequest) -> DirectiveResponse:
    service.log.close()
    return DirectiveResponse()


@utility('LOG SCREEN ON', summary='Writes each directive with its answer to the console.')
def _log_screen_on(service: ArmorService, _: DirectiveRequest) -> DirectiveResponse:
    service.log.on_screen = True
    return DirectiveResponse()


@utility('LOG SCREEN OFF', summary='Ends LOG SCREEN ON.')
def _log_screen_off(service: ArmorService, _: DirectiveRequest) -> DirectiveResponse:
    service.log.on_screen = False
    return DirectiveResponse()


@utility('INVALID COMMAND', summary='Always answered with 205; for tests of clients.')
def _invalid(_: ArmorService, __: DirectiveRequest) -> DirectiveResponse:
    raise DirectiveError('Invalid command.', ExitCode.INVALID_COMMAND)


@control('APPLY', summary='Applies the changes that wait; derived facts follow only at REASON.')
def _apply(ref: Reference) -> None:
    ref.flush()


@control(
    'REASON',
    summary='Applies the changes that wait and brings the derived facts up to date.',
    differs='Recovers from an inconsistent ontology once its cause is retracted; ARMOR does not '
    'with buffering.',
)
def _reason(ref: Reference) -> None:
    ref.reason()
