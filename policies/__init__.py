"""Strategies that choose the next probe from the observation alone.

All of them rest on one predictor, `palpate.recognizer.predict`: what poses that stand for the
belief say a probe would meet. `outcomes` holds these reports against each other, `candidates`
proposes probes, `weighing` takes the one that a strategy's formula likes best.
"""

from collections.abc import Callable
from importlib import import_module

from .decision_region import DecisionRegion
from .grid import Grid
from .information import Information
from .lookahead import Lookahead
from .minimax import Minimax
from .outcomes.task import GOALS, Goal, Task
from .pairs import Pairs
from .policy import Policy
from .pruning import Pruning
from .random_hit import RandomHit
from .random_probe import RandomProbe
from .rate import Rate
from .refine import Refine
from .safe_region import SafeRegion
from .separation import Separation

__all__ = [
    "GOALS",
    "POLICY_NAMES",
    "DecisionRegion",
    "Goal",
    "Grid",
    "Information",
    "Lookahead",
    "Minimax",
    "Pairs",
    "Policy",
    "Pruning",
    "RandomHit",
    "RandomProbe",
    "Rate",
    "Refine",
    "SafeRegion",
    "Separation",
    "Task",
    "make_policy",
]

_POLICIES: dict[str, Callable[[Task], Policy]] = {
    "random": RandomProbe,
    "random-hit": RandomHit,
    "grid": Grid,
    "separation": Separation,
    "pairs": Pairs,
    "minimax": Minimax,
    "information": Information,
    "pruning": Pruning,
    "safe-region": SafeRegion,
    "decision-region": DecisionRegion,
    "rate": Rate,
    "lookahead": Lookahead,
    "refine": Refine,
}

POLICY_NAMES = tuple(_POLICIES)


def make_policy(name: str, task: Task) -> Policy:
    """The strategy of a name.

    Args:
        name: one of `POLICY_NAMES`, or ``module:Class`` of your own, made with the task alone.
        task: what is public of the episodes that it will choose probes for.

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
