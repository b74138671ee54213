"""The part of the client that changes an ontology."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from surveillance_ontology.armor.operations import (
    ArmorServiceInternalError,
    ClientPart,
    Steps,
    checked,
    operation,
)
from surveillance_ontology.armor.protocol import (
    DirectiveRequest,
    DirectiveResponse,
    ExitCode,
    ListResponse,
)


class Manipulation(ClientPart):
    """Directives that change the ontology.

    All return whether the ontology is consistent; with buffering, as of the last reasoning. All
    raise `ArmorServiceCallError` and `ArmorServiceInternalError`. Values are given as text.
    """

    def _change(self, words: str, *args: str) -> Steps[bool]:
        response: DirectiveResponse = checked((yield self.request(words, *args)))
        return response.is_consistent

    def _change_all(self, requests: Sequence[DirectiveRequest]) -> Steps[bool]:
        if not requests:
            return True
        answer: ListResponse = yield requests
        for response in answer.responses:
            checked(response)
        return answer.is_consistent

    @operation
    def add_ind(self, ind_name: str) -> Steps[bool]:
        """Make an individual known."""
        return (yield from self._change('ADD IND', ind_name))

    @operation
    def add_ind_to_class(self, ind_name: str, class_name: str) -> Steps[bool]:
        """Assert that an individual is of a class."""
        return (yield from self._change('ADD IND CLASS', ind_name, class_name))

    @operation
    def add_class(self, class_name: str, super_class_name: str = '') -> Steps[bool]:
        """Make a class known, below another if one is given."""
        if super_class_name:
            return (yield from self._change('ADD CLASS CLASS', class_name, super_class_name))
        return (yield from self._change('ADD CLASS', class_name))

    @operation
    def disj_inds(self, ind_names: Iterable[str]) -> Steps[bool]:
        """State that individuals are different."""
        return (yield from self._change('DISJOINT IND', *ind_names))

    @operation
    def disj_inds_of_class(self, class_name: str) -> Steps[bool]:
        """State that the instances of a class, as of the last reasoning, are different."""
        return (yield from self._change('DISJOINT IND CLASS', class_name))

    @operation
    def disj_classes(self, class_names: Iterable[str]) -> Steps[bool]:
        """State that no two classes share an instance."""
        return (yield from self._change('DISJOINT CLASS', *class_names))

    @operation
    def disj_subclasses(self, class_name: str) -> Steps[bool]:
        """State that no two subclasses of a class share an instance."""
        return (yield from self._change('DISJOINT CLASS CLASS', class_name))

    @operation
    def make_equivalent(self, class_name: str) -> Steps[bool]:
        """Turn what a class is a subclass of into its definition."""
        return (yield from self._change('MAKE EQUIVALENT CLASS', class_name))

    @operation
    def add_min_cardinality(
        self, class_name: str, objectprop_name: str, cardinality: int, value_class_name: str
    ) -> Steps[bool]:
        """State that instances of a class have so many values of a property at least."""
        args = (class_name, objectprop_name, str(cardinality), value_class_name)
        return (yield from self._change('ADD CARDINALITY MIN', *args))

    @operation
    def add_objectprop_to_ind(
        self, objectprop_name: str, ind_name: str, value_obj_name: str
    ) -> Steps[bool]:
        """Relate an individual to another."""
        args = (objectprop_name, ind_name, value_obj_name)
        return (yield from self._change('ADD OBJECTPROP IND', *args))

    @operation
    def add_dataprop_to_ind(
        self, dataprop_name: str, ind_name: str, value_type: str, value: str
    ) -> Steps[bool]:
        """Add a value to a data property of an individual; ``value_type`` as LONG, STRING, ..."""
        args = (dataprop_name, ind_name, value_type, value)
        return (yield from self._change('ADD DATAPROP IND', *args))

    @operation
    def add_batch_dataprop_to_ind(
        self, ind_name: str, properties: Iterable[Sequence[str]]
    ) -> Steps[bool]:
        """Add values, each ``[property, type, value]``, in one batch."""
        return (yield from self._change_all(self._dataprops('ADD', ind_name, properties)))

    @operation
    def replace_objectprop_b2_ind(
        self, objectprop_name: str, ind_name: str, new_value: str, old_value: str
    ) -> Steps[bool]:
        """Relate an individual to a new one instead of an old one."""
        args = (objectprop_name, ind_name, new_value, old_value)
        return (yield from self._change('REPLACE OBJECTPROP IND', *args))

    @operation
    def replace_dataprop_b2_ind(
        self, dataprop_name: str, ind_name: str, value_type: str, new_value: str, old_value: str
    ) -> Steps[bool]:
        """Put a new value in the place of an old one; both bare or as queries return them."""
        args = (dataprop_name, ind_name, value_type, new_value, old_value)
        return (yield from self._change('REPLACE DATAPROP IND', *args))

    @operation
    def replace_one_dataprop_b2_ind(
        self, dataprop_name: str, ind_name: str, value_type: str, new_value: str
    ) -> Steps[bool]:
        """Put a value in the place of the only one there is, or add it when there is none.

        Raises:
            ArmorServiceInternalError: 206, there are several values.
        """
        query = self.request('QUERY DATAPROP IND', dataprop_name, ind_name)
        old = checked((yield query)).queried_objects
        _check_single(old, dataprop_name, ind_name)
        if not old:
            args = (dataprop_name, ind_name, value_type, new_value)
            return (yield from self._change('ADD DATAPROP IND', *args))
        args = (dataprop_name, ind_name, value_type, new_value)
        return (yield from self._change('REPLACE DATAPROP IND', *args, old[0]))

    @operation
    def replace_one_objectprop_b2_ind(
        self, objectprop_name: str, ind_name: str, new_value: str
    ) -> Steps[bool]:
        """Relate to a new individual instead of the only one there is, or add it without any.

        Raises:
            ArmorServiceInternalError: 206, there are several.
        """
        query = self.request('QUERY OBJECTPROP IND', objectprop_name, ind_name)
        old = checked((yield query)).queried_objects
        _check_single(old, objectprop_name, ind_name)
        if not old:
            args = (objectprop_name, ind_name, new_value)
            return (yield from self._change('ADD OBJECTPROP IND', *args))
        args = (objectprop_name, ind_name, new_value)
        return (yield from self._change('REPLACE OBJECTPROP IND', *args, old[0]))

    @operation
    def remove_ind(self, ind_name: str) -> Steps[bool]:
        """Remove an individual with all that is asserted of it."""
        return (yield from self._change('REMOVE IND', ind_name))

    @operation
    def remove_ind_from_class(self, ind_name: str, class_name: str) -> Steps[bool]:
        """Retract that an individual is of a class."""
        return (yield from self._change('REMOVE IND CLASS', ind_name, class_name))

    @operation
    def remove_class(self, class_name: str, super_class_name: str = '') -> Steps[bool]:
        """Remove a class, or only that it is below another."""
        if super_class_name:
            return (yield from self._change('REMOVE CLASS CLASS', class_name, super_class_name))
        return (yield from self._change('REMOVE CLASS', class_name))

    @operation
    def remove_dataprop_from_ind(
        self, dataprop_name: str, ind_name: str, value_type: str, value: str
    ) -> Steps[bool]:
        """Retract a value of a data property."""
        args = (dataprop_name, ind_name, value_type, value)
        return (yield from self._change('REMOVE DATAPROP IND', *args))

    @operation
    def remove_batch_dataprop_to_ind(
        self, ind_name: str, properties: Iterable[Sequence[str]]
    ) -> Steps[bool]:
        """Retract values, each ``[property, type, value]``, in one batch."""
        return (yield from self._change_all(self._dataprops('REMOVE', ind_name, properties)))

    @operation
    def remove_objectprop_from_ind(
        self, objectprop_name: str, ind_name: str, value_obj_name: str
    ) -> Steps[bool]:
        """Retract a relation."""
        args = (objectprop_name, ind_name, value_obj_name)
        return (yield from self._change('REMOVE OBJECTPROP IND', *args))

    @operation
    def rename_ind(self, old_name: str, new_name: str) -> Steps[bool]:
        """Give an individual another name."""
        return (yield from self._change('RENAME IND', old_name, new_name))

    @operation
    def rename_class(self, old_name: str, new_name: str) -> Steps[bool]:
        """Give a class another name."""
        return (yield from self._change('RENAME CLASS', old_name, new_name))

    @operation
    def rename_dataprop(self, old_name: str, new_name: str) -> Steps[bool]:
        """Give a data property another name."""
        return (yield from self._change('RENAME DATAPROP', old_name, new_name))

    @operation
    def rename_objectprop(self, old_name: str, new_name: str) -> Steps[bool]:
        """Give an object property another name."""
        return (yield from self._change('RENAME OBJECTPROP', old_name, new_name))

    def _dataprops(
        self, command: str, ind_name: str, properties: Iterable[Sequence[str]]
    ) -> list[DirectiveRequest]:
        return [
            self.request(f'{command} DATAPROP IND', prop, ind_name, value_type, value)
            for prop, value_type, value in properties
        ]


def _check_single(values: list[str], prop: str, ind: str) -> None:
    if len(values) > 1:
        raise ArmorServiceInternalError(
            f'{prop} of {ind} has {len(values)} values, expected one: {", ".join(values)}',
            ExitCode.SEVERAL_VALUES,
        )
