// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/read_example.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <filesystem>
#include <limits>
#include <utility>

namespace sonocase::pipeline::inline texture {
namespace {

struct Pixels {
    int width = 0, height = 0, channels = 0, alpha = -1;
    std::vector<float> value;  // as stored, not scaled
    OIIO::TypeDesc::BASETYPE type = OIIO::TypeDesc::UNKNOWN;
};

Result<Pixels> read_pixels(const std::string& path, int frame) {
    std::error_code status;
    if (!std::filesystem::is_regular_file(path, status)) {
        return Error{"no such file", path, "expected an image: PNG, TIFF or a DICOM frame"};
    }
    try {
        OIIO::ImageSpec configuration;
        configuration["oiio:UnassociatedAlpha"] = 1;
        auto input = OIIO::ImageInput::open(path, &configuration);
        if (!input) {
            std::string why = OIIO::geterror();
            std::replace(why.begin(), why.end(), '\n', ' ');
            return Error{"not an image that can be read" + (why.empty() ? "" : " (" + why + ")"),
                         path, "expected PNG, TIFF or a DICOM frame"};
        }
        if (!input->seek_subimage(frame, 0)) {
            return Error{"no frame " + std::to_string(frame), path, "frames count from 0"};
        }
        const OIIO::ImageSpec spec = input->spec();
        constexpr int kMax = 16384;
        if (spec.width < 1 || spec.height < 1 || spec.nchannels < 1 || spec.width > kMax ||
            spec.height > kMax || spec.nchannels > 8 || spec.depth > 1) {
            return Error{"image of " + std::to_string(spec.width) + " x " +
                             std::to_string(spec.height) + " x " + std::to_string(spec.depth) +
                             " pixels, " + std::to_string(spec.nchannels) + " channels",
                         path, "expected a flat image of at most 16384 pixels a side"};
        }
        Pixels out;
        out.width = spec.width;
        out.height = spec.height;
        out.channels = spec.nchannels;
        out.alpha = spec.alpha_channel;
        out.type = static_cast<OIIO::TypeDesc::BASETYPE>(spec.format.basetype);
        out.value.resize(static_cast<std::size_t>(spec.width) * spec.height * spec.nchannels);
        if (!input->read_image(frame, 0, 0, spec.nchannels, OIIO::TypeDesc::FLOAT,
                               out.value.data())) {
            std::string why = input->geterror();
            std::replace(why.begin(), why.end(), '\n', ' ');
            return Error{"image cannot be read to its end (" + why + ")", path,
                         "the file looks damaged; export it again"};
        }
        return out;
    } catch (const std::exception& failure) {
        return Error{std::string("image cannot be read (") + failure.what() + ")", path,
                     "expected PNG, TIFF or a DICOM frame"};
    }
}

// Grey of OpenImageIO's 1.0.
double grey_scale(const Pixels& pixels, std::vector<std::string>* notes, const std::string& path) {
    float top = 0;
    for (const float v : pixels.value) {
        if (std::isfinite(v)) top = std::max(top, v);
    }
    using T = OIIO::TypeDesc;
    if (pixels.type == T::UINT8 || pixels.type == T::INT8) return 255;
    if (pixels.type == T::UINT16 || pixels.type == T::INT16 || pixels.type == T::UINT32 ||
        pixels.type == T::INT32) {
        const double full = pixels.type == T::UINT16   ? 65535.0
                            : pixels.type == T::INT16  ? 32767.0
                            : pixels.type == T::UINT32 ? 4294967295.0
                                                       : 2147483647.0;
        const double stored = top * full;
        for (const double used : {255.0, 1023.0, 4095.0}) {
            if (stored <= used && full > used) {
                if (notes) {
                    notes->push_back(path +
                                     ": greater pixel type than its values need; read with " +
                                     std::to_string(static_cast<int>(used)) + " as white.");
                }
                return 255 * full / used;
            }
        }
        return 255;
    }
    return top > 1.5f ? 1 : 255;  // floating point, in [0, 255] or [0, 1]
}

Result<PixelRectangle> part_of(const Pixels& pixels,
                               const std::optional<PixelRectangle>& wanted,
                               const std::string& path) {
    if (!wanted) return PixelRectangle{0, 0, pixels.width, pixels.height};
    const PixelRectangle part = *wanted;
    if (part.width < 1 || part.height < 1 || part.x < 0 || part.y < 0 ||
        part.x > pixels.width - part.width || part.y > pixels.height - part.height) {
        return Error{"rectangle " + std::to_string(part.x) + "," + std::to_string(part.y) + "," +
                         std::to_string(part.width) + "," + std::to_string(part.height) +
                         " leaves the image of " + std::to_string(pixels.width) + " x " +
                         std::to_string(pixels.height) + " pixels",
                     path, "expected x,y,width,height inside the image"};
    }
    return part;
}

Result<Pixels> read_mask_for(const Pixels& pixels, const std::string& path) {
    SONOCASE_TRY(auto mask, read_pixels(path, 0));
    if (mask.width != pixels.width || mask.height != pixels.height) {
        return Error{"mask of " + std::to_string(mask.width) + " x " + std::to_string(mask.height) +
                         " pixels for an image of " + std::to_string(pixels.width) + " x " +
                         std::to_string(pixels.height),
                     path, "expected a mask of the image's size"};
    }
    return mask;
}

}  // namespace

Result<ExampleImage> read_example(const std::string& path,
                                  const ReadExampleOptions& options,
                                  std::vector<std::string>* notes) {
    SONOCASE_TRY(auto read, read_pixels(path, options.frame));
    const Pixels& pixels = read;
    SONOCASE_TRY(const auto rectangle, part_of(pixels, options.rectangle, path));
    const PixelRectangle part = rectangle;
    Pixels mask;
    double mask_scale = 0;
    if (!options.mask_path.empty()) {
        SONOCASE_TRY(auto read_mask, read_mask_for(pixels, options.mask_path));
        mask = std::move(read_mask);
        mask_scale = grey_scale(mask, nullptr, options.mask_path);
    }
    const double scale = grey_scale(pixels, notes, path);
    const int colours = pixels.channels - (pixels.alpha >= 0 ? 1 : 0) >= 3 ? 3 : 1;
    ExampleImage image;
    image.name = std::filesystem::path(path).filename().string();
    image.width = part.width;
    image.height = part.height;
    image.grey.resize(image.count());
    image.use.assign(image.count(), 1);
    std::size_t coloured = 0, transparent = 0;
    for (int y = 0; y < part.height; ++y) {
        for (int x = 0; x < part.width; ++x) {
            const std::size_t at =
                part.x + x + static_cast<std::size_t>(pixels.width) * (part.y + y);
            const float* v = pixels.value.data() + at * pixels.channels;
            const std::size_t to = image.index(x, y);
            double grey = v[0];
            if (colours == 3) {
                grey = 0.299 * v[0] + 0.587 * v[1] + 0.114 * v[2];
                const double spread = std::max({v[0], v[1], v[2]}) - std::min({v[0], v[1], v[2]});
                if (spread * scale > 48) {
                    image.use[to] = 0;
                    ++coloured;
                }
            }
            if (pixels.alpha >= 0 && !(v[pixels.alpha] * (scale == 1 ? 1.0 / 255 : 1.0) > 0.002)) {
                transparent += image.use[to];
                image.use[to] = 0;
            }
            if (mask.width > 0) {
                const float m = mask.value[at * mask.channels];
                if (!(m * mask_scale > 127.5)) image.use[to] = 0;
            }
            const double stored = grey * scale;
            image.grey[to] = std::isfinite(stored)
                                 ? static_cast<float>(std::clamp(stored, 0.0, 255.0))
                                 : std::numeric_limits<float>::quiet_NaN();
        }
    }
    if (notes && coloured > 0) {
        notes->push_back(path + ": " + std::to_string(coloured) +
                         " pixels of strong colour (markers, Doppler) were left out.");
    }
    if (notes && transparent > 0) {
        notes->push_back(path + ": " + std::to_string(transparent) +
                         " transparent pixels were left out.");
    }
    return image;
}

}  // namespace sonocase::pipeline::inline texture
