"""The directives: a table, and one module for each kind of directive that fills it.

A directive is one decorated function. Manipulations and queries get the `Reference` that they
mean, the others the `Workspace`.
"""

from armor_service.directives import (  # noqa: F401 - the modules fill the table
    closing,
    manchester,
    manipulations,
    queries,
    references,
)
from armor_service.directives.table import TABLE, Directive, Kind, look_up

__all__ = ['TABLE', 'Directive', 'Kind', 'look_up']
