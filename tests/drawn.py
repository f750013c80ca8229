"""What a picture shows, as text, for a file that keeps it."""

from pathlib import Path

import numpy as np

from later import Later

colors, style = Later("matplotlib.colors"), Later("matplotlib.style")


def drawn(monkeypatch, module, draw):
    """Text of the one figure that a function of a module draws into a file."""
    figures = []
    monkeypatch.setattr(module, "save_figure", lambda figure, file, **options: figures.append(told(figure, options)))
    with style.context("default"):
        draw(Path("picture.png"))
    (text,) = figures
    return text


def told(figure, options):
    """Size, options of saving, legends, and of all axes the scales, texts, lines, circles and arrows."""
    text = [f"{figure.get_size_inches().round(3).tolist()} {options}"]
    for axes in figure.axes:
        words = axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), axes.get_xscale(), axes.get_yscale()
        text.append(f"axes {words} grid: {axes.xaxis.get_gridlines()[0].get_visible()}")
        text.append(f"view: {of_points(axes.viewLim.get_points())}")
        for line in axes.lines:
            look = line.get_label(), line.get_marker(), line.get_linestyle(), line.get_markersize(), line.get_alpha()
            paint = colors.to_hex(line.get_color()), line.get_linewidth(), line.get_zorder()
            text.append(f"line {look + paint}: {of_points(line.get_xydata())}")
        for circle in axes.patches:
            paint = colors.to_hex(circle.get_facecolor(), keep_alpha=True), circle.get_zorder()
            text.append(f"circle {circle.radius:g} {paint}: {of_points([circle.center])}")
        text += [f"text {each.get_text()!r}: {of_points([each.xy, each.xyann])}" for each in axes.texts]
        for arrows in axes.collections:
            text.append(f"arrows: {of_points(np.column_stack([arrows.get_offsets(), arrows.U, arrows.V]))}")
    for legend in (*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))):
        words = [each.get_text() for each in (legend.get_title(), *legend.get_texts())]
        text.append(f"legend {words} framed: {legend.get_frame_on()}")
    return "\n".join(text)


def of_points(points):
    """Numbers of every point, in brackets."""
    return " ".join(f"({', '.join(f'{number + 0.0:.4g}' for number in point)})" for point in points)
