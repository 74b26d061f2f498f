// SPDX-License-Identifier: Apache-2.0

#include "pipeline/texture/read_example.h"

#include <dlfcn.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "pipeline/texture/image_module.h"

namespace sonocase::pipeline::inline texture {
namespace {

// Beside the program, as it is built, or where it is installed. Opened once, never closed.
Result<ReadImage*> reader() {
    static constexpr const char* kModule = "sonocase_images.so";
    static const Result<ReadImage*> opened = []() -> Result<ReadImage*> {
        std::error_code failed;
        const auto self = std::filesystem::read_symlink("/proc/self/exe", failed);
        const auto bin = self.parent_path();
        std::string why = "no such file";
        for (const auto& folder : {bin, bin / SONOCASE_MODULES}) {
            const std::string file = (folder / kModule).string();
            if (!std::filesystem::exists(file, failed)) continue;
            if (void* module = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL)) {
                if (void* found = dlsym(module, "sonocase_read_image"))
                    return reinterpret_cast<ReadImage*>(found);
            }
            if (const char* said = dlerror()) why = said;
        }
        return Error{"the reader of images cannot be opened (" + why + ")", kModule,
                     "expected beside the program " + self.string() +
                         "; install sonocase again, or build all of it"};
    }();
    return opened;
}

Result<StoredImage> read_pixels(const std::string& path, int frame) {
    std::error_code status;
    if (std::filesystem::is_directory(path, status)) {
        return Error{"a folder", path,
                     "expected an image: PNG, TIFF or a DICOM frame (--examples takes a folder of "
                     "patches)"};
    }
    if (!std::filesystem::is_regular_file(path, status)) {
        return Error{"no such file", path, "expected an image: PNG, TIFF or a DICOM frame"};
    }
    SONOCASE_TRY(ReadImage * read, reader());
    StoredImage image;
    std::string why;
    const ImageFailure failure = read(path.c_str(), frame, image, why);
    if (!why.empty()) why = " (" + why + ")";
    switch (failure) {
        case ImageFailure::none: return image;
        case ImageFailure::not_an_image:
            return Error{"not an image that can be read" + why, path,
                         "expected PNG, TIFF or a DICOM frame"};
        case ImageFailure::no_frame:
            return Error{"no frame " + std::to_string(frame), path, "frames count from 0"};
        case ImageFailure::size:
            return Error{"image of " + std::to_string(image.width) + " x " +
                             std::to_string(image.height) + " x " + std::to_string(image.depth) +
                             " pixels, " + std::to_string(image.channels) + " channels",
                         path, "expected a flat image of at most 16384 pixels a side"};
        case ImageFailure::damaged:
            return Error{"image cannot be read to its end" + why, path,
                         "the file looks damaged; export it again"};
        case ImageFailure::other: break;
    }
    return Error{"image cannot be read" + why, path, "expected PNG, TIFF or a DICOM frame"};
}

// Grey of OpenImageIO's 1.0.
double grey_scale(const StoredImage& pixels,
                  std::vector<std::string>* notes,
                  const std::string& path) {
    float top = 0;
    for (const float v : pixels.value) {
        if (std::isfinite(v)) top = std::max(top, v);
    }
    // Floating point, in [0, 255] or [0, 1].
    if (pixels.full == 0) return top > 1.5f ? 1 : 255;
    const double stored = top * pixels.full;
    for (const double used : {255.0, 1023.0, 4095.0}) {
        if (stored <= used && pixels.full > used) {
            if (notes) {
                notes->push_back(path + ": greater pixel type than its values need; read with " +
                                 std::to_string(static_cast<int>(used)) + " as white.");
            }
            return 255 * pixels.full / used;
        }
    }
    return 255;
}

Result<PixelRectangle> part_of(const StoredImage& pixels,
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

Result<StoredImage> read_mask_for(const StoredImage& pixels, const std::string& path) {
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
    const StoredImage& pixels = read;
    SONOCASE_TRY(const auto rectangle, part_of(pixels, options.rectangle, path));
    const PixelRectangle part = rectangle;
    StoredImage mask;
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
