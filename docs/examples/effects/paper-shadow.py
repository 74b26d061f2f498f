# SPDX-License-Identifier: Apache-2.0
"""shadow: bone and gas dim what lies behind them, by exp(-mm of them / 4).

The kidney behind ribs. Without the effect what ribs hide is seen.
"""
from torso import kidney


def show(torso):
    view = kidney(torso, model="paper")
    on, off = view.pair("shadow")
    behind = view.truth.shadowed > 0
    return on, off, "mean grey behind bone, without and with", off[behind].mean(), on[behind].mean()
