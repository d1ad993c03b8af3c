"""The figures, one module each: what they draw, as plain values that Plotly understands.

palette              colours that everybody can tell apart, in light and dark
canvas               axes, layouts and numbers that figures share
link_styles          how links are drawn
map_layers           layers of maps: circles, vehicles, links, landmarks
formation_figure     the formation at time 0
animation_figure     one period
timeline_figure      contacts over a period
spectrum_figure      singular values and the gap
accuracy_figure      errors, predicted and found
comparison_figure    before and after; a refinement
errors_figure        errors over time
consistency_figure   ANEES, NIS and coverage
sweep_figure         errors over what was varied
figure_table         the table of figures
catalogue            the figures of a plan or report, drawn
html_page            a page of figures that works offline
images               figures as PNG, SVG and PDF
plotly_figures       figures as Plotly's own objects: syncplan.figures
"""
