"""emcee's ensembles: a proposal fitted in a warm-up, draws until they converge, states to resume from."""
