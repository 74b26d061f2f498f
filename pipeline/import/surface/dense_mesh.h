// SPDX-License-Identifier: Apache-2.0

// A scan of millions of triangles, reduced to what a fit needs. Internal to import.
#pragma once

#include "formats/base/stage_report.h"
#include "formats/volume/surface.h"

class vtkPolyData;

namespace sonocase::pipeline {

inline constexpr std::size_t kDenseTriangles = 400000;  // a mesh of more is reduced

// The vertices in each cube of 4 mm become one at their mean (vtkBinnedDecimation), which lies
// within 4^2 / (24 R) of a surface of radius R: 0.02 mm on a body. Parts of less than 2 % of the
// largest part's triangles are left out: dust, the feet of a stand, specks of the floor. report
// measures given_triangles, reduction_rms_mm and reduction_max_mm: distances of 20,000 given
//         vertices from the reduced mesh (vtkStaticCellLocator), and small_parts; may be null
// data    triangles alone
// scale   mm per unit of data
// Cost: 0.4 us per triangle, and 60 bytes.
Surface reduce_mesh(vtkPolyData& data, double scale, StageReport* report);

}  // namespace sonocase::pipeline
