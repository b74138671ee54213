"""The fixtures of the directive service's own tests: a service, a way to ask it, a client."""

from libs.armor_service.tests.conftest import ask, client, service  # noqa: F401
