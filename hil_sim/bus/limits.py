"""What a classical CAN frame can hold. Source: ISO 11898-1."""

MAX_DATA_LENGTH = 8
HIGHEST_STANDARD_ID = 0x7FF
"""Of the identifiers with 11 bits."""
HIGHEST_EXTENDED_ID = 0x1FFFFFFF
"""Of those with 29 bits."""
