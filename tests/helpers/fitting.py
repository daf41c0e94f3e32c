"""The poses of interpretations, each looked for alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from palpate.recognizer import Constraints, Contacts, PairTables, Polyhedron, SearchLimits
from palpate.recognizer.models.features import Features, face_features
from palpate.recognizer.poses.entry import SolidEntry
from palpate.recognizer.poses.fits.pose import Poses
from palpate.recognizer.poses.pose_search import Aim, test_interpretations


class Fitter:
    """The search for poses of a model, with the features of all contacts chosen beforehand."""

    def __init__(
        self, model: Polyhedron, features: Features | None = None, *, nodes: int = 2_000_000
    ) -> None:
        self.features = features or face_features(model)
        tables = PairTables.of(model, self.features)
        self.entry = SolidEntry.made(model, self.features, tables)
        self.aim = Aim(
            Constraints(), SearchLimits(nodes=nodes), np.radians(3.0), 0.01 * model.diameter
        )

    def run(self, interpretations: NDArray[np.int32], contacts: Contacts) -> Poses:
        """A pose of each that isn't ruled out."""
        none = np.zeros((0, interpretations.shape[1]), np.int32)
        rows = [none, *(row[None] for row in interpretations)]
        return Poses.join(
            [test_interpretations(self.entry, row, contacts, self.aim) for row in rows]
        )
