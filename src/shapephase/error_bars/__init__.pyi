from .covariance import InertiaErrors, Uncertainty, sampled_uncertainty, uncertainty
from .result_derivatives import Derivatives, ResultDerivative, derivatives

__all__ = [
    "Derivatives",
    "InertiaErrors",
    "ResultDerivative",
    "Uncertainty",
    "derivatives",
    "sampled_uncertainty",
    "uncertainty",
]
