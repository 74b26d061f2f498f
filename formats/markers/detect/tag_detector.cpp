// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/detect/tag_detector.h"

#include <algorithm>
#include <cmath>

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <dlfcn.h>

#include "formats/markers/marker_set.h"

namespace sonocase {
namespace {

// The functions of libapriltag that are called.
struct Library {
    decltype(&tag36h11_create) family_create = nullptr;
    decltype(&tag36h11_destroy) family_destroy = nullptr;
    decltype(&apriltag_detector_create) create = nullptr;
    decltype(&apriltag_detector_destroy) destroy = nullptr;
    decltype(&apriltag_detector_add_family_bits) add_family = nullptr;
    decltype(&apriltag_detector_detect) detect = nullptr;
    decltype(&apriltag_detections_destroy) detections_destroy = nullptr;
    bool complete = false;
};

template <class Function>
bool find(void* library, const char* name, Function& function) {
    function = reinterpret_cast<Function>(dlsym(library, name));
    return function != nullptr;
}

// Opened once, never closed.
const Library& library() {
    static const Library opened = [] {
        Library l;
        void* handle = dlopen("libapriltag.so.3", RTLD_NOW | RTLD_LOCAL);
        if (!handle) return l;
        l.complete = find(handle, "tag36h11_create", l.family_create) &&
                     find(handle, "tag36h11_destroy", l.family_destroy) &&
                     find(handle, "apriltag_detector_create", l.create) &&
                     find(handle, "apriltag_detector_destroy", l.destroy) &&
                     find(handle, "apriltag_detector_add_family_bits", l.add_family) &&
                     find(handle, "apriltag_detector_detect", l.detect) &&
                     find(handle, "apriltag_detections_destroy", l.detections_destroy);
        return l;
    }();
    return opened;
}

}  // namespace

struct TagDetector::State {
    apriltag_family_t* family = nullptr;
    apriltag_detector_t* detector = nullptr;
    std::vector<std::uint8_t> mirrored;

    ~State() {
        if (detector) library().destroy(detector);
        if (family) library().family_destroy(family);
    }

    // Every tag that is read with certainty, by id; `twice` gets the ids read in two places.
    std::vector<SeenTag> read(const GreyPicture& picture, std::vector<int>& twice) {
        // The library does not write into the picture.
        image_u8_t image = {picture.width_px, picture.height_px, picture.stride,
                            const_cast<std::uint8_t*>(picture.pixels)};
        zarray_t* found = library().detect(detector, &image);
        std::vector<SeenTag> tags;
        for (int i = 0; i < zarray_size(found); ++i) {
            apriltag_detection_t* seen = nullptr;
            zarray_get(found, i, &seen);
            // Below this the cells are hardly told apart: noise reads as a tag now and then.
            constexpr float kMinMargin = 12;
            if (seen->decision_margin < kMinMargin) continue;
            SeenTag tag;
            tag.id = seen->id;
            tag.corrected = seen->hamming;
            // The library's first pixel has its middle at (0.5, 0.5).
            for (int k = 0; k < 4; ++k) tag.corners[k] = {seen->p[k][0] - 0.5, seen->p[k][1] - 0.5};
            tags.push_back(tag);
        }
        library().detections_destroy(found);
        std::stable_sort(tags.begin(), tags.end(),
                         [](const SeenTag& a, const SeenTag& b) { return a.id < b.id; });
        for (std::size_t i = 0; i + 1 < tags.size(); ++i)
            if (tags[i].id == tags[i + 1].id && (twice.empty() || twice.back() != tags[i].id))
                twice.push_back(tags[i].id);
        return tags;
    }
};

TagDetector::TagDetector(std::unique_ptr<State> state) : state_(std::move(state)) {}
TagDetector::TagDetector(TagDetector&&) noexcept = default;
TagDetector& TagDetector::operator=(TagDetector&&) noexcept = default;
TagDetector::~TagDetector() = default;

Result<TagDetector> TagDetector::create() {
    if (!library().complete) {
        return Error{"the library that finds printed tags is not installed", "libapriltag.so.3",
                     "install it: apt install libapriltag3"};
    }
    auto state = std::make_unique<State>();
    state->family = library().family_create();
    state->detector = library().create();
    // One wrong cell is corrected: two would let five times as much noise pass as a tag.
    library().add_family(state->detector, state->family, 1);
    state->detector->nthreads = 1;
    state->detector->quad_decimate = 2;
    state->detector->quad_sigma = 0;
    state->detector->refine_edges = true;
    state->detector->decode_sharpening = 0.25;
    return TagDetector(std::move(state));
}

TagFindings TagDetector::find(const GreyPicture& picture) {
    // Where the board is in view, its many large tags are worth more than is needed: a third of
    // their pixels will do.
    constexpr std::size_t kMany = 12;
    constexpr double kLarge = 1500;  // pixels
    constexpr int kAll = 600, kFew = 200;
    TagFindings out;
    std::vector<SeenTag> tags = state_->read(picture, out.twice);
    for (SeenTag& tag : tags) {
        if (std::binary_search(out.twice.begin(), out.twice.end(), tag.id)) continue;
        double twice_area = 0;
        for (int k = 0; k < 4; ++k) {
            const Pixel a = tag.corners[k], b = tag.corners[(k + 1) % 4];
            twice_area += a.x * b.y - b.x * a.y;
        }
        const bool sparse = tags.size() > kMany && std::abs(twice_area) > 2 * kLarge;
        if (tag.id < kMarkerTagIds && fit_tag(picture, tag, sparse ? kFew : kAll)) {
            out.tags.push_back(tag);
        } else {
            ++out.unrefined;
        }
    }
    return out;
}

int TagDetector::count_mirrored(const GreyPicture& picture) {
    const std::size_t width = picture.width_px, height = picture.height_px;
    state_->mirrored.resize(width * height);
    for (std::size_t y = 0; y < height; ++y) {
        const std::uint8_t* row = picture.pixels + y * picture.stride;
        std::reverse_copy(row, row + width, state_->mirrored.begin() + y * width);
    }
    std::vector<int> twice;
    return static_cast<int>(
        state_
            ->read({state_->mirrored.data(), picture.width_px, picture.height_px, picture.width_px},
                   twice)
            .size());
}

}  // namespace sonocase
