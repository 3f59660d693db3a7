"""The paper's figures 10 to 14, drawn again from a motor of the independent truth, each with what the paper says of it.

marimo edit notebooks/paper.py -- --seed N
python notebooks/paper.py --seed N        prints what is met and what is not; takes a minute or two
"""
# ruff: noqa: PLR1711 (marimo writes `return` at the end of every cell)

import marimo

__generated_with = "0.25.2"
app = marimo.App(width="medium", app_title="The paper's figures, from the plant")


@app.cell
def _():
    import sys
    from pathlib import Path

    import marimo as mo
    import numpy as np
    from matplotlib.figure import Figure

    root = str(Path(__file__).parents[1])
    sys.path[:0] = [place for place in (root, f"{root}/tests") if place not in sys.path]
    from benchmarks.filters import estimates, paced
    from benchmarks.paper import ENDWINDINGS, MAGNET, calibrated, errors_K, first_guess, hot_spot, wrong_by_the_paper_s
    from replay.engine.results.open_loop import modelled
    from replay.show.words.palette import COLOURS, DASHES

    return (
        COLOURS,
        DASHES,
        ENDWINDINGS,
        Figure,
        MAGNET,
        calibrated,
        errors_K,
        estimates,
        first_guess,
        hot_spot,
        mo,
        modelled,
        np,
        paced,
        wrong_by_the_paper_s,
    )


@app.cell
def _(mo):
    mo.md(r"""
    # The paper's figures, from a motor whose truth is known

    "Identification and Update of Thermal Models in Digital Twins of ePowertrain Motors" calibrates a network of 21 nodes on S1 and
    S2 points, checks it on a WLTP, and lets an extended Kalman filter find the magnet loss from endwindings and rotor surface. Here a
    conduction mesh with its own losses and sensors stands on the bench. Its motor file is a first guess, 16 K too cold at the magnets and 5 K at the
    hottest endwinding; the WLTC is not learnt from. The filter begins with an open loop 6 K too cold; the magnet sensor is never given to it.
    """)
    return


@app.cell
def _(calibrated, estimates, first_guess, mo, paced, wrong_by_the_paper_s):
    seed = int(mo.cli_args().get("seed") or 200)
    guess, lacked_W = first_guess(seed)
    motor = calibrated(seed, guess, lacked_W)
    wrong = wrong_by_the_paper_s(calibrated(seed, guess, 0.0), 1)
    found = estimates(wrong, paced(wrong))
    return found, motor, wrong


@app.cell
def _(COLOURS, DASHES, Figure, modelled, np):
    def shown(case, edges, channel):
        """Hours, measured and modelled [degC] of a channel."""
        o = next(one for one in case.recorded.observations if one.sensor.name == channel)
        hours = np.arange(len(o.measured)) * case.inputs.step_s / 3600
        nodes = tuple(node.name for node in case.network.nodes)
        return hours, np.where(o.good, o.measured, np.nan), modelled(o, case.recorded, edges, nodes)

    def over_time(title, unit, lines):
        """`lines`: (label, hours, values), the first one black."""
        figure = Figure(figsize=(7.6, 2.6), layout="constrained")
        axes = figure.subplots()
        for i, (label, hours, values) in enumerate(lines):
            colour, dashes = ("#1b1f24", "-") if i == 0 else (COLOURS[i - 1], DASHES[i - 1])
            axes.plot(60 * hours, values, color=colour, linestyle=dashes, linewidth=1.1, label=label)
        axes.set_xlabel("time since start [min]")
        axes.set_ylabel(unit)
        axes.set_title(title, loc="left", fontsize=10)
        axes.legend(frameon=False, fontsize=8)
        return figure

    return over_time, shown


@app.cell
def _(ENDWINDINGS, MAGNET, errors_K, found, mo, motor, wrong):
    def verdict(says, met):
        return f"{'met' if met else 'NOT met'}: {says}"

    open_mean, open_largest = errors_K(wrong, found["open loop"][0], (MAGNET,))
    magnet_mean, magnet_largest = errors_K(wrong, found["EKF"][0], (MAGNET,))
    ew_mean, ew_largest = errors_K(wrong, found["EKF"][0], ENDWINDINGS)
    hot, cold = motor.gains["endwinding gain"], motor.gains["magnet gain"]
    statements = {
        10: verdict(
            f"calibration gains at least 3 K at the hot spot ({hot:.1f} K) and 10 K at the magnets ({cold:.1f} K)",
            hot >= 3 and cold >= 10,
        ),
        11: verdict(
            f"magnets under 1.6 K mean and 6 K at most ({magnet_mean:.1f} and {magnet_largest:.1f} K; open loop {open_mean:.1f} and "
            f"{open_largest:.1f} K)",
            magnet_mean < 1.6 and magnet_largest < 6,
        ),
        12: verdict(
            f"endwinding A under 2 K mean and 8 K at most (both: {ew_mean:.1f} and {ew_largest:.1f} K)",
            ew_mean < 2 and ew_largest < 8,
        ),
        13: verdict(
            f"endwinding B under 2 K mean and 8 K at most (both: {ew_mean:.1f} and {ew_largest:.1f} K)",
            ew_mean < 2 and ew_largest < 8,
        ),
        14: "the estimated loss beside the model's; the paper shows no truth, here the smoother shows what the filter's lag hides",
    }
    if mo.app_meta().mode == "script":
        print("\n".join(f"Fig. {number}: {text}" for number, text in statements.items()))
    return (statements,)


@app.cell
def _(ENDWINDINGS, MAGNET, found, hot_spot, mo, motor, over_time, shown, statements, wrong):
    guessed, fitted = motor.guessed, motor.checked
    figures = []
    for channel in (hot_spot(guessed), MAGNET):
        hours, measured, before = shown(guessed, guessed.open_loop, channel)
        _, _, after = shown(fitted, fitted.open_loop, channel)
        lines = [("measured", hours, measured), ("first guess", hours, before), ("calibrated", hours, after)]
        figures.append((10, over_time(f"Fig. 10: {channel}, calibrated against first guess", "°C", lines)))
    for number, channel in ((11, MAGNET), (12, ENDWINDINGS[0]), (13, ENDWINDINGS[1])):
        hours, measured, alone = shown(wrong, wrong.open_loop, channel)
        lines = [("measured", hours, measured), ("open loop", hours, alone)]
        lines += [(way, hours, shown(wrong, found[way][0], channel)[2]) for way in ("EKF", "smoother")]
        figures.append((number, over_time(f"Fig. {number}: {channel}", "°C", lines)))
    hours = shown(wrong, wrong.open_loop, MAGNET)[0]
    losses = [(way, hours, found[way][1][: len(hours)]) for way in ("EKF", "smoother")]
    figures.append((14, over_time("Fig. 14: magnet loss beside the model's", "W", losses)))
    mo.vstack([item for number, figure in figures for item in (figure, mo.md(statements[number]))])
    return (figures,)


if __name__ == "__main__":
    app.run()
