"""The folded sheet as geometry: one cell, and the sheet of cells."""
