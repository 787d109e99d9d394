"""Normal equations of a record, bounded Gauss-Newton on them, and what keeps a fit from answering."""
