"""Expected errors of points: how far each is likely from the true surface."""

from pcsr.uncertainty.expected import ExpectedErrors, errors_of, expected_errors

__all__ = ["ExpectedErrors", "errors_of", "expected_errors"]
