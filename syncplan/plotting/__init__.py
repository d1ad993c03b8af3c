"""The figures, one module each: what they draw, as plain values that Plotly understands.

palette              colours that everyone can tell apart, in light and dark
canvas               axes, layouts and numbers that figures share
link_styles          how links are drawn
map_layers           layers of maps: circles, vehicles, links, landmarks
figure_table         the table of figures; it names the module of each
catalogue            the figures of a plan or report, drawn
html_page            a page of figures that works offline
images               figures as PNG, SVG and PDF
plotly_figures       figures as Plotly's own objects: syncplan.figures
"""
