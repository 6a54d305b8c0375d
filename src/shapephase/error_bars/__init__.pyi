from .angles_in_time import somersault_bars
from .covariance import Uncertainty, sampled_uncertainty, uncertainty
from .error_sources import InertiaErrors
from .forced_covariance import ForcedUncertainty
from .recorded_flight import RecordedFlight, motion_from_recording
from .recorded_momentum import RecordedMomentum, momentum_from_recording
from .result_derivatives import Derivatives, ResultDerivative, derivatives

__all__ = [
    "Derivatives",
    "ForcedUncertainty",
    "InertiaErrors",
    "RecordedFlight",
    "RecordedMomentum",
    "ResultDerivative",
    "Uncertainty",
    "derivatives",
    "momentum_from_recording",
    "motion_from_recording",
    "sampled_uncertainty",
    "somersault_bars",
    "uncertainty",
]
