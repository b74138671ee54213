"""The page's interface as OpenAPI 3.1, made from what is served."""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Callable, Mapping
from typing import Any

from surveillance_operator.page.access import least_role

_TYPES: Mapping[Any, str] = {
    float: 'number',
    int: 'integer',
    bool: 'boolean',
    str: 'string',
}
_GIVEN = ('by', 'leaves')
"""Parameters that the server fills in."""
_ANSWER = {
    'description': 'What came of it, in words as `text` or as further fields.',
    'content': {
        'application/json': {
            'schema': {
                'type': 'object',
                'properties': {'ok': {'type': 'boolean'}, 'text': {'type': 'string'}},
                'required': ['ok'],
            }
        }
    },
}
_REFUSED = {'description': 'It was refused; `text` says why, in one line.'}


def description(
    questions: Mapping[str, Callable[..., Any]],
    actions: Mapping[str, Callable[..., Any]],
    documents: Mapping[str, Callable[..., Any]],
) -> dict[str, Any]:
    """Return the interface as OpenAPI describes one.

    Args:
        questions: Asked by GET at `/ask/NAME`.
        actions: Carried out by POST at `/act/NAME`.
        documents: Fetched by GET at `/get/NAME`.
    """
    paths: dict[str, Any] = {
        '/events': {
            'get': {
                'summary': 'What changes, as server-sent events: the newest parts of the page.',
                'parameters': [_parameter('robot', {'type': 'string'}, needed=False)],
                'responses': {'200': {'description': 'text/event-stream', 'content': {}}},
            }
        }
    }
    for name, call in sorted(questions.items()):
        paths[f'/ask/{name}'] = {'get': _asked(name, call)}
    for name, call in sorted(documents.items()):
        answer = {'200': {'description': 'The file.'}, '422': _REFUSED}
        paths[f'/get/{name}'] = {'get': {**_asked(name, call), 'responses': answer}}
    for name, call in sorted(actions.items()):
        role = least_role(name, {})
        paths[f'/act/{name}'] = {
            'post': {
                'operationId': f'act_{name}',
                'summary': _summary(call, name),
                'description': f'Takes the role {role}, and the header Origin of the page.',
                'requestBody': {'content': {'application/json': {'schema': _body(call)}}},
                'responses': {'200': _ANSWER, '403': _REFUSED, '422': _REFUSED},
            }
        }
    return {
        'openapi': '3.1.0',
        'info': {'title': 'Mission page', 'version': '1'},
        'components': {
            'securitySchemes': {'token': {'type': 'http', 'scheme': 'bearer'}},
        },
        'security': [{'token': []}, {}],
        'paths': paths,
    }


def _asked(name: str, call: Callable[..., Any]) -> dict[str, Any]:
    return {
        'operationId': name,
        'summary': _summary(call, name),
        'parameters': [
            _parameter(each.name, _schema(each.annotation), needed=each.default is each.empty)
            for each in _fields(call)
        ],
        'responses': {'200': _ANSWER, '422': _REFUSED},
    }


def _body(call: Callable[..., Any]) -> dict[str, Any]:
    fields = _fields(call)
    needed = [each.name for each in fields if each.default is each.empty]
    return {
        'type': 'object',
        'properties': {each.name: _schema(each.annotation) for each in fields},
        **({'required': needed} if needed else {}),
    }


def _fields(call: Callable[..., Any]) -> list[inspect.Parameter]:
    try:
        signature = inspect.signature(call, eval_str=True)
    except (NameError, TypeError):
        signature = inspect.signature(call)
    return [
        each
        for each in signature.parameters.values()
        if each.name not in _GIVEN and each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)
    ]


def _schema(annotation: Any) -> dict[str, Any]:
    if annotation in _TYPES:
        return {'type': _TYPES[annotation]}
    origin, parts = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (types.UnionType, typing.Union):
        known = [_TYPES[each] for each in parts if each in _TYPES]
        return {'type': known} if known else {}
    if isinstance(origin, type) and issubclass(origin, typing.Sequence):
        return {'type': 'array', 'items': _schema(parts[0]) if parts else {}}
    return {}


def _parameter(name: str, schema: dict[str, Any], *, needed: bool) -> dict[str, Any]:
    return {'name': name, 'in': 'query', 'required': needed, 'schema': schema}


def _summary(call: Callable[..., Any], name: str) -> str:
    said = (inspect.getdoc(call) or '').strip().split('\n')[0]
    return said or name.replace('_', ' ')
