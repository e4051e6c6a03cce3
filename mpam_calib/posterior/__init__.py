"""From recordings and a model to posterior draws: reduced data, collapsed likelihood, emcee ensembles."""
