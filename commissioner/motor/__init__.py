"""The motor as equations: nameplate, equivalent circuits and exact models, with their conversions."""
