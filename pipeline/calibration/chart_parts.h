// SPDX-License-Identifier: Apache-2.0

// Parts that the pictures of the calibrations share. Internal to pipeline/calibration.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "formats/base/result.h"
#include "formats/calibration/point.h"
#include "pipeline/pictures/chart.h"

namespace sonocase::pipeline {

using ChartColour = std::array<std::uint8_t, 3>;
inline constexpr ChartColour kUsed{31, 119, 180}, kLeftOut{214, 39, 40}, kGuide{150, 150, 150},
    kSecond{255, 127, 14}, kThird{44, 160, 44};

Series marks(const std::string& name, ChartColour colour, double size = 5);
Series stroke(const std::string& name, ChartColour colour, double width = 1.5);

// Residual of each reading, those left out as crosses.
Chart residual_chart(std::span<const PoseResidual> residuals,
                     const std::string& title,
                     double rms_mm);

// Writes FOLDER/NAME.png and .svg; makes the folder.
Status draw(std::span<const Chart> charts,
            int columns,
            const std::string& folder,
            const std::string& name);

}  // namespace sonocase::pipeline
