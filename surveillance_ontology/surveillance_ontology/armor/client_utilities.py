"""The part of the client for references, files, buffers and logging."""

from __future__ import annotations

from surveillance_ontology.armor.operations import (
    ArmorServiceCallError,
    ClientPart,
    Steps,
    checked,
    operation,
)
from surveillance_ontology.armor.protocol import DirectiveResponse


class Utils(ClientPart):
    """Directives about references, files and logging."""

    def _do(self, words: str, *args: str) -> Steps[None]:
        checked((yield self.request(words, *args)))

    @operation
    def apply_buffered_changes(self) -> Steps[bool]:
        """Apply buffered manipulations; whether the ontology was consistent at the last REASON."""
        response: DirectiveResponse = checked((yield self.request('APPLY')))
        return response.is_consistent

    @operation
    def sync_buffered_reasoner(self) -> Steps[bool]:
        """Apply buffered manipulations and reason; whether the ontology is consistent."""
        response: DirectiveResponse = checked((yield self.request('REASON')))
        return response.is_consistent

    @operation
    def save_ref_with_inferences(self, filepath: str) -> Steps[None]:
        """Save with the derived facts."""
        yield from self._do('SAVE INFERENCE', filepath)

    @operation
    def save(self, filepath: str, inference: bool = False) -> Steps[None]:
        """Save, with the derived facts if asked for; an empty path is the file that was loaded."""
        yield from self._do('SAVE INFERENCE' if inference else 'SAVE', filepath)

    @operation
    def load_ref_from_file(
        self,
        owl_file_path: str,
        iri: str,
        buffered_manipulation: bool = False,
        reasoner: str = 'PELLET',
        buffered_reasoner: bool = False,
        mounted: bool = False,
    ) -> Steps[None]:
        """Load an ontology; nothing happens when the reference is loaded already."""
        flags = (str(buffered_manipulation), reasoner, str(buffered_reasoner))
        words = 'LOAD FILE MOUNTED' if mounted else 'LOAD FILE'
        yield from self._do(words, owl_file_path, iri, *flags)

    @operation
    def drop_ref(self) -> Steps[None]:
        """Forget the reference."""
        yield from self._do('DROP')

    @operation
    def mount_on_ref(self) -> Steps[None]:
        """Let only this client change the ontology."""
        yield from self._do('MOUNT')

    @operation
    def unmount_from_ref(self) -> Steps[None]:
        """End `mount_on_ref`."""
        yield from self._do('UNMOUNT')

    @operation
    def get_all_refs(self) -> Steps[list[str]]:
        """Names of all references."""
        response: DirectiveResponse = checked((yield self.request('GET ALL REFS')))
        return response.queried_objects

    @operation
    def get_ref_client(self, reference_name: str = '') -> Steps[str | None]:
        """The client mounted on a reference (the own one if none is named); None when nobody is."""
        name = reference_name or self.client.reference_name
        response: DirectiveResponse = checked((yield self.request('GET REF CLIENT', name)))
        mounted = response.queried_objects[0]
        return None if mounted == 'none' else mounted

    @operation
    def set_log_to_terminal(self, switch: bool) -> Steps[None]:
        """Switch the server's log on its console."""
        yield from self._do(f'LOG SCREEN {"ON" if switch else "OFF"}')

    @operation
    def set_log_to_file(self, switch: bool, filepath: str = '') -> Steps[None]:
        """Switch the server's log to a file."""
        if switch:
            if not filepath:
                raise ArmorServiceCallError('set_log_to_file: expected the path of a file')
            yield from self._do('LOG FILE ON', filepath)
        else:
            yield from self._do('LOG FILE OFF')
