"""What poses that stand for a belief say a probe would meet."""

from .pose_samples import sample_belief
from .prediction import PoseSamples, Predictions, predict
from .probes import ProbeSpace, TriadRays

__all__ = ["PoseSamples", "Predictions", "ProbeSpace", "TriadRays", "predict", "sample_belief"]
