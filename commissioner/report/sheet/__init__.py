"""What is printed and signed: the form of a sheet (A4 and Letter, 390 px), its marks, numbers and drawings. In: records'
texts and numbers; out: one self-contained HTML text. Drawings are plain SVG: no plotting library is loaded."""
