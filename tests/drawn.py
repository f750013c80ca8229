"""What a picture shows, as text, for a file that keeps it."""

from pathlib import Path

from later import Later

style = Later("matplotlib.style")


def drawn(monkeypatch, module, draw):
    """Text of the one figure that a function of a module draws into a file."""
    figures = []
    monkeypatch.setattr(module, "save_figure", lambda figure, file, **options: figures.append(told(figure, options)))
    with style.context("default"):
        draw(Path("picture.png"))
    (text,) = figures
    return text


def told(figure, options):
    """Size, options of saving, legends, and of all axes the scales, texts and lines with their style and points."""
    text = [f"{figure.get_size_inches().tolist()} {options}"]
    for axes in figure.axes:
        words = axes.get_title(), axes.get_xlabel(), axes.get_ylabel(), axes.get_xscale(), axes.get_yscale()
        text.append(f"axes {words} grid: {axes.xaxis.get_gridlines()[0].get_visible()}")
        for line in axes.lines:
            look = line.get_label(), line.get_marker(), line.get_linestyle(), line.get_markersize(), line.get_alpha()
            points = (f"({x:.4g}, {y:.4g})" for x, y in line.get_xydata())
            text.append(f"line {look}: {' '.join(points)}")
    for legend in (*figure.legends, *filter(None, (axes.get_legend() for axes in figure.axes))):
        text.append(f"legend {[each.get_text() for each in legend.get_texts()]} framed: {legend.get_frame_on()}")
    return "\n".join(text)
