"""The integral of a posterior: Laplace's next term, quadrature, weighted draws, bridges."""
