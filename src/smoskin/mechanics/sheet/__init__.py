"""The whole folded sheet: bars and hinges on columns, under touches that grip it."""
