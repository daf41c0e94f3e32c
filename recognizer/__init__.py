"""The recogniser: contacts in, belief out. It knows no simulator.

The method is the interpretation tree of W. E. L. Grimson and T. Lozano-Perez, "Model-Based
Recognition and Localization from Sparse Range or Tactile Data", MIT AI Memo 738, 1983. In order:

- `models`: a mesh becomes planar faces with the solid's own symmetries; an outline, edges;
- `contacts`: what was felt and what else is known, with bounds that hold;
- `tables`: what two points on two given faces can be to each other, once a model;
- `tree`: a face for each contact, pruned pair by pair;
- `poses`: the pose that an interpretation allows, or a proof that there is none;
- `beliefs`: interpretations with the same pose are one hypothesis;
- `predict`: what a belief's poses say a probe would meet;
- `advice`: the verdict in words, why nothing fits, which parts look alike.

`recognize` runs them in a row over a library, and `belief` is what comes out.

How it differs from the memo: tables are exact for concave faces too; position error enters every
constraint, twice the bound for a difference of two points; the direction constraint's interval has
its ends in order and its angles clamped; poses come from a joint fit of normals and offsets;
rotations are compared by the angle between them, up to the object's symmetries.

Conventions: metres and radians; poses map model to world (``T_world_object``); normals point
outwards; a bound is the radius of a ball (position) or the half-angle of a cone (normal) that holds
the truth for certain.
"""

from .advice.diagnosis import Finding, diagnose
from .belief import Belief
from .beliefs.comparison import PoseDifference, pose_difference
from .beliefs.hypotheses import Hypothesis, PoseTolerance
from .beliefs.search import Search
from .contacts.contact_file import FeltFile, read_contacts
from .contacts.contacts import ANYTHING, EDGE, FACE, VERTEX, ContactKind, Contacts
from .contacts.free_space import FreeSpace
from .contacts.support import SupportPlane
from .models.folder import load_folder
from .models.polygon import Polygon
from .models.polyhedron import Polyhedron
from .predict.pose_samples import sample_belief
from .predict.prediction import PoseSamples, Predictions, predict
from .predict.probes import ProbeSpace, TriadRays
from .recognize import Recognizer
from .tables.ranges import PairTables
from .tree.limits import SearchLimits
from .tree.tree import Constraints

__all__ = [
    "ANYTHING",
    "EDGE",
    "FACE",
    "VERTEX",
    "Belief",
    "Constraints",
    "ContactKind",
    "Contacts",
    "FeltFile",
    "Finding",
    "FreeSpace",
    "Hypothesis",
    "PairTables",
    "Polygon",
    "Polyhedron",
    "PoseDifference",
    "PoseSamples",
    "PoseTolerance",
    "Predictions",
    "ProbeSpace",
    "Recognizer",
    "Search",
    "SearchLimits",
    "SupportPlane",
    "TriadRays",
    "diagnose",
    "load_folder",
    "pose_difference",
    "predict",
    "read_contacts",
    "sample_belief",
]
