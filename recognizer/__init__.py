"""The recogniser: contacts in, belief out. It knows no simulator.

The method is the interpretation tree of W. E. L. Grimson and T. Lozano-Perez, "Model-Based
Recognition and Localization from Sparse Range or Tactile Data", MIT AI Memo 738, 1983. In order:

- `polyhedron`: a mesh becomes planar faces with the solid's own symmetries;
- `ranges`: what two points on two given faces can be to each other, tabled once a model;
- `tree`: a face for each contact, pruned pair by pair;
- `pose`: the pose that an interpretation allows, or a proof that there is none;
- `hypotheses`: interpretations with the same pose are one;
- `recognize`: the five in a row, over a library; `solid_recognize` and `planar_recognize` run them
  for one solid, as one compiled search, and for one outline of the plane.

How it differs from the memo: tables are exact for concave faces too; position error enters every
constraint, twice the bound for a difference of two points; the direction constraint's interval has
its ends in order and its angles clamped; poses come from a joint fit of normals and offsets;
rotations are compared by the angle between them, up to the object's symmetries.

Conventions: metres and radians; poses map model to world (``T_world_object``); normals point
outwards; a bound is the radius of a ball (position) or the half-angle of a cone (normal) that holds
the truth for certain.
"""

from .advice.diagnosis import Finding, diagnose
from .belief import Belief, Search
from .beliefs.comparison import PoseDifference, pose_difference
from .beliefs.hypotheses import Hypothesis, PoseTolerance
from .contacts.contact_file import FeltFile, read_contacts
from .contacts.contacts import ANYTHING, EDGE, FACE, VERTEX, Contacts
from .contacts.free_space import FreeSpace
from .contacts.support import SupportPlane
from .models.folder import load_folder
from .models.polygon import Polygon
from .models.polyhedron import Polyhedron
from .recognize import Recognizer, SearchLimits
from .tables.ranges import PairTables
from .tree.tree import Constraints

__all__ = [
    "ANYTHING",
    "EDGE",
    "FACE",
    "VERTEX",
    "Belief",
    "Constraints",
    "Contacts",
    "FeltFile",
    "Finding",
    "FreeSpace",
    "Hypothesis",
    "PairTables",
    "Polygon",
    "Polyhedron",
    "PoseDifference",
    "PoseTolerance",
    "Recognizer",
    "Search",
    "SearchLimits",
    "SupportPlane",
    "diagnose",
    "load_folder",
    "pose_difference",
    "read_contacts",
]
