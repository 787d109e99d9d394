"""What a run found, in the forms that other programs read: parameter lists and the models of other simulators. In: the result
document and the plate; out: bytes of one file. A form is one file here, named in `forms`."""
