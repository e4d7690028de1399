"""skincli: headless batch renderer for skin, with a procedural skin generator."""

__version__ = "0.1.0"
