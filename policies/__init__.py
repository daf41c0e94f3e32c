"""Strategies that choose the next probe from the observation alone."""

from importlib import import_module

from .policy import Policy
from .random_probe import RandomProbe
from .task import Task

__all__ = ["POLICY_NAMES", "Policy", "RandomProbe", "make_policy"]

_POLICIES = {"random": RandomProbe}

POLICY_NAMES = tuple(_POLICIES)


def make_policy(name: str, task: Task | None = None) -> Policy:
    """The strategy of a name.

    Raises:
        ValueError: an unknown name; the message lists the known ones.
    """
    module, colon, attribute = name.partition(":")
    if colon:
        try:
            return getattr(import_module(module), attribute)(task)
        except (ImportError, AttributeError) as missing:
            raise ValueError(f"there is no policy {name!r}: {missing}") from missing
    if name not in _POLICIES:
        raise ValueError(f"no policy is called {name!r}; there are: {', '.join(POLICY_NAMES)}")
    return _POLICIES[name](task)
