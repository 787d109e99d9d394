"""From no cause to the accepted ones: score test, stepwise selection, exchanges, refinement."""
