"""What the extended model predicts: currents and sensitivities from held voltages to reported samples."""
