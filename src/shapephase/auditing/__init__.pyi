from ._airborne import AirbornePart
from ._consistency import RateAgreement
from ._engine_faults import StepOrder
from .audit_result import Audit, RunAudit
from .figures import audit_figure, write_audit_figure
from .flight_recorder import FlightRecorder, assert_right_in_flight
from .floating_trajectory import FloatingTrajectory, TrajectoryNoise
from .hypothesis import FittedValue, Hypothesis
from .page import audit_page
from .reading import read_trajectory
from .trajectory_audit import audit

__all__ = [
    "AirbornePart",
    "Audit",
    "FittedValue",
    "FlightRecorder",
    "FloatingTrajectory",
    "Hypothesis",
    "RateAgreement",
    "RunAudit",
    "StepOrder",
    "TrajectoryNoise",
    "assert_right_in_flight",
    "audit",
    "audit_figure",
    "audit_page",
    "read_trajectory",
    "write_audit_figure",
]
