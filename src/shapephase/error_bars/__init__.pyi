from .covariance import Uncertainty, sampled_uncertainty, uncertainty
from .inertia_errors import InertiaErrors
from .recorded_momentum import RecordedMomentum, momentum_from_recording
from .result_derivatives import Derivatives, ResultDerivative, derivatives

__all__ = [
    "Derivatives",
    "InertiaErrors",
    "RecordedMomentum",
    "ResultDerivative",
    "Uncertainty",
    "derivatives",
    "momentum_from_recording",
    "sampled_uncertainty",
    "uncertainty",
]
