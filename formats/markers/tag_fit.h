// SPDX-License-Identifier: Apache-2.0

// Where a tag lies in a picture, to a few hundredths of a pixel: the whole pattern, which is known
// once its id is read, is laid over the picture by least squares on the grey values.
//
// A tag's corner is no saddle, so that the usual sub-pixel search there is off by ten times more;
// and lines fitted to the four outer edges alone are drawn aside by the cells behind the border,
// since a cell of a small tag is hardly wider than the blur. Unknowns are the four corners, black,
// white, the blur along both axes of the tag, so that defocus and motion are allowed for, and how
// bright it is half a cell beyond each edge, where a body is folded: taken for white, what lies
// there moves the whole tag by up to a tenth of a pixel.
// Pixels that do not fit (a finger, a glare) weigh little.
#pragma once

#include <array>
#include <cstdint>

#include "formats/markers/camera_model.h"

namespace sonocase {

// A grey picture, row by row; the pixels belong to the caller.
struct GreyPicture {
    const std::uint8_t* pixels = nullptr;
    int width_px = 0, height_px = 0;
    int stride = 0;  // bytes from row to row, >= width_px
};

struct SeenTag {
    int id = 0;
    std::array<Pixel, 4> corners;  // in the order of tag_corners()
    int corrected = 0;             // cells that were read wrongly
    // After fit_tag(): upper triangular U, row by row, so that U times the errors of the corners
    // (x0, y0, x1, ...) has the covariance 1.
    std::array<double, 64> whitening{};
    double contrast = 0;  // white less black, grey values
    double residual = 0;  // root mean square, grey values
    double blur_px = 0;   // the larger of the two, one standard deviation
};

// Refines the corners of a tag that are known to a pixel or two. False: the picture there does not
// look like this tag; `tag` is then as it came. max_pixels: no more are looked at, evenly spread.
// Cost: about 0.7 us per pixel looked at. No allocation.
bool fit_tag(const GreyPicture& picture, SeenTag& tag, int max_pixels = 600);

// A lens bends a tag's edges, and fit_tag() lays straight ones over them: where its corners come to
// lie, less where the lens shows them. At a picture's edge that is a tenth of a pixel and more, the
// same way in all pictures. corners: either. Cost: about 4 us; nothing without distortion.
std::array<Pixel, 4> bend_of_tag(const CameraModel& camera, const std::array<Pixel, 4>& corners);
// Takes it out of a tag's corners.
void unbend_tag(const CameraModel& camera, SeenTag& tag);

}  // namespace sonocase
