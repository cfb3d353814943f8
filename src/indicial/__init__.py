"""indicial: unsteady aerodynamics for flight dynamics, from a shape to a flown, identified, checked model."""

__version__ = "0.1.0"
