"""How fast posteriors are drawn, beside other samplers: ``make benchmark``."""
