"""dynresp: a character that takes a hit and goes on moving like a person."""

__version__ = "0.1.0"
