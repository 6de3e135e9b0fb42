"""The equations of a mechanism in other tools: CasADi, JAX, SymPy, from the one recording of the core."""

from .for_casadi import CasadiEquations
from .for_jax import JaxEquations
from .for_sympy import SympyEquations
from .recorded import Output, Recorded
from .tape import Tape

__all__ = ["CasadiEquations", "JaxEquations", "Output", "Recorded", "SympyEquations", "Tape"]
