"""Studies: what measures the figures of the documents, on shipped specs and recorded performers.

Outside the wheel. `python -m studies` lists them.
"""
