// SPDX-License-Identifier: Apache-2.0

// Cells of the envelope without a frame, for the effects that take means of them.
#pragma once

#include <algorithm>

#include "imaging_support.h"
#include "runtime/imaging/physical/fast/cell_rows.h"
#include "runtime/imaging/physical/fast/physical_kernels.h"
#include "runtime/imaging/physical/model/physical_tables.h"

namespace sonocase::testing {

// 64 rows of 192 beams, 150 mm deep, machine `modern`.
struct CellBench {
    static constexpr int kRows = 64, kLines = 192;
    Exercise exercise = phantom_exercise();
    runtime::ScanGeometry geometry;
    runtime::physical::Tables tables;
    runtime::CellRows cells;

    CellBench() {
        exercise.probe.depth_mm = 150;
        geometry = runtime::make_scan_geometry(exercise.probe, kLines, kRows * 8, 128, 128);
        tables = runtime::physical::make_tables(exercise.probe, Machine{}, geometry);
        cells.resize(kRows, kLines + 2 * runtime::kRowMargin + runtime::kRowSlack);
    }
    float& envelope(int row, int line) { return cells.row(row)[line]; }
    void fill(float value) { std::fill(cells.envelope.begin(), cells.envelope.end(), value); }
};

}  // namespace sonocase::testing
