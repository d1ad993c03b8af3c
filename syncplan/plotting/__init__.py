"""The figures, one module each: what they draw, as plain values that Plotly understands."""
