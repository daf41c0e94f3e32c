"""Strategies that choose the next probe from the observation alone."""

from .policy import Policy
from .random_probe import RandomProbe

__all__ = ["POLICY_NAMES", "Policy", "RandomProbe", "make_policy"]

_POLICIES = {"random": RandomProbe}

POLICY_NAMES = tuple(_POLICIES)


def make_policy(name: str) -> Policy:
    """The strategy of a name.

    Raises:
        ValueError: an unknown name; the message lists the known ones.
    """
    if name not in _POLICIES:
        raise ValueError(f"no policy is called {name!r}; there are: {', '.join(POLICY_NAMES)}")
    return _POLICIES[name]()
