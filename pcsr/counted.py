"""A number with its noun."""


def counted(count: int, noun: str) -> str:
    """Return a number and a noun in the singular or plural.

    Args:
        count: the number.
        noun: the noun in the singular, whose plural ends in s.

    Examples:
        >>> counted(1, "run"), counted(2000, "step")
        ('1 run', '2000 steps')
    """
    return f"{count} {noun}{'' if count == 1 else 's'}"
