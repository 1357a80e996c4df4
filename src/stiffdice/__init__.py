"""How many time steps does a stiff ground cost, and what do you get for them?"""

__version__ = "0.1.0"
