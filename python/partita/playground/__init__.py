"""A page on which a mechanism runs and can be changed; `Mechanism.to_playground` writes it."""

from .page import html
from .program import PULL, Program, changeable, functions_of, held, program

__all__ = ["PULL", "Program", "changeable", "functions_of", "held", "html", "program"]
