// SPDX-License-Identifier: Apache-2.0

#include "formats/markers/detect/tag_detector.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#ifndef __EMSCRIPTEN__
#include <dlfcn.h>
#endif

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

#ifdef __EMSCRIPTEN__

// A page's program has no libraries beside it: this one is linked in.
const Library& library() {
    static const Library linked = {tag36h11_create,
                                   tag36h11_destroy,
                                   apriltag_detector_create,
                                   apriltag_detector_destroy,
                                   apriltag_detector_add_family_bits,
                                   apriltag_detector_detect,
                                   apriltag_detections_destroy,
                                   true};
    return linked;
}

#else

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

#endif

}  // namespace

struct TagDetector::State {
    apriltag_family_t* family = nullptr;
    apriltag_detector_t* detector = nullptr;
    std::vector<std::uint8_t> mirrored;

    ~State() {
        if (detector) library().destroy(detector);
        if (family) library().family_destroy(family);
    }

    // Adds every tag that is read with certainty.
    void read(const GreyPicture& picture,
              const PictureRegion& region,
              int step,
              std::vector<SeenTag>& tags) {
        const int x0 = std::max(0, region.x0), y0 = std::max(0, region.y0);
        const int width = std::min(picture.width_px, region.x1) - x0;
        const int height = std::min(picture.height_px, region.y1) - y0;
        constexpr int kMinSide = 16;  // pixels
        if (width < kMinSide || height < kMinSide) return;
        // The library does not write into the picture.
        image_u8_t image = {width, height, picture.stride,
                            const_cast<std::uint8_t*>(picture.pixels) +
                                static_cast<std::ptrdiff_t>(y0) * picture.stride + x0};
        detector->quad_decimate = static_cast<float>(step);
        zarray_t* found = library().detect(detector, &image);
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
            for (int k = 0; k < 4; ++k)
                tag.corners[k] = {seen->p[k][0] - 0.5 + x0, seen->p[k][1] - 0.5 + y0};
            tags.push_back(tag);
        }
        library().detections_destroy(found);
    }
};

namespace {

constexpr int kFindStep = 2, kSearchStep = 3;  // pixels

PictureRegion whole(const GreyPicture& picture) {
    return {0, 0, picture.width_px, picture.height_px};
}

Pixel middle_of(const SeenTag& tag) {
    Pixel sum;
    for (const Pixel& c : tag.corners) sum.x += 0.25 * c.x, sum.y += 0.25 * c.y;
    return sum;
}
double way(Pixel a, Pixel b) {
    return std::hypot(a.x - b.x, a.y - b.y);
}
double diagonal_of(const SeenTag& tag) {
    return std::max(way(tag.corners[0], tag.corners[2]), way(tag.corners[1], tag.corners[3]));
}

// Sorted by id, each place once; ids in two places go to `twice` and stay.
void sort_by_id(std::vector<SeenTag>& tags, std::vector<int>& twice) {
    std::stable_sort(tags.begin(), tags.end(),
                     [](const SeenTag& a, const SeenTag& b) { return a.id < b.id; });
    std::size_t kept = 0;
    for (const SeenTag& tag : tags) {
        if (kept > 0 && tags[kept - 1].id == tag.id) {
            const bool same =
                way(middle_of(tags[kept - 1]), middle_of(tag)) < 0.5 * diagonal_of(tag);
            if (!same && (twice.empty() || twice.back() != tag.id)) twice.push_back(tag.id);
            continue;
        }
        tags[kept++] = tag;
    }
    tags.resize(kept);
}

}  // namespace

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
    TagFindings out;
    std::vector<SeenTag> tags;
    state_->read(picture, whole(picture), kFindStep, tags);
    sort_by_id(tags, out.twice);
    for (SeenTag& tag : tags) {
        if (std::binary_search(out.twice.begin(), out.twice.end(), tag.id)) continue;
        if (tag.id < kMarkerTagIds && fit_tag(picture, tag)) {
            out.tags.push_back(tag);
        } else {
            ++out.unrefined;
        }
    }
    return out;
}

void TagDetector::read(const GreyPicture& picture,
                       const PictureRegion& region,
                       int step,
                       std::vector<SeenTag>& tags) {
    state_->read(picture, region, step, tags);
}

int TagDetector::count_mirrored(const GreyPicture& picture) {
    const std::size_t width = picture.width_px, height = picture.height_px;
    state_->mirrored.resize(width * height);
    for (std::size_t y = 0; y < height; ++y) {
        const std::uint8_t* row = picture.pixels + y * picture.stride;
        std::reverse_copy(row, row + width, state_->mirrored.begin() + y * width);
    }
    const GreyPicture mirrored{state_->mirrored.data(), picture.width_px, picture.height_px,
                               picture.width_px};
    std::vector<SeenTag> tags;
    state_->read(mirrored, whole(mirrored), kFindStep, tags);
    return static_cast<int>(tags.size());
}

PictureFollower::PictureFollower(TagDetector detector, MarkerFollower follower)
    : detector_(std::move(detector)), follower_(std::move(follower)) {
    twice_until_.fill(-1);
    if (const MarkerBody* board = follower_.body(MarkerRole::board)) {
        const std::size_t count = board->tags.size();
        std::vector<double> gap(count, 1e9);
        std::size_t next = 0;
        for (std::size_t k = 0; k < count; ++k) {
            board_order_.push_back(static_cast<int>(next));
            const Point3 at = board->tags[next].body_from_tag * Point3{};
            for (std::size_t t = 0; t < count; ++t)
                gap[t] = std::min(gap[t], distance(at, board->tags[t].body_from_tag * Point3{}));
            next = static_cast<std::size_t>(std::max_element(gap.begin(), gap.end()) - gap.begin());
        }
    }
}

// A board that stands where it stood needs no search: its pattern is laid over the picture there.
void PictureFollower::look_at_board(const GreyPicture& picture) {
    constexpr int kEnough = 8, kTried = 12, kFewPixels = 250;
    const MarkerBody* board = follower_.body(MarkerRole::board);
    const std::optional<Rigid> pose = follower_.expected_board();
    if (!board || !pose) return;
    const auto corners_of = [&](const MarkerTag& tag, SeenTag& at) {
        at.id = tag.id;
        const std::array<Point3, 4> corners = tag_corners(tag);
        for (int k = 0; k < 4; ++k) {
            if (!project(follower_.camera(), *pose * corners[k] - Point3{}, at.corners[k], nullptr))
                return false;
            if (!(at.corners[k].x > 1 && at.corners[k].y > 1 &&
                  at.corners[k].x < picture.width_px - 2 &&
                  at.corners[k].y < picture.height_px - 2))
                return false;
        }
        return true;
    };
    int tried = 0;
    PictureRegion around{picture.width_px, picture.height_px, 0, 0};
    for (const int index : board_order_) {
        SeenTag tag;
        if (!corners_of(board->tags[index], tag)) continue;
        for (const Pixel& c : tag.corners) {
            around.x0 = std::min(around.x0, static_cast<int>(c.x));
            around.y0 = std::min(around.y0, static_cast<int>(c.y));
            around.x1 = std::max(around.x1, static_cast<int>(c.x));
            around.y1 = std::max(around.y1, static_cast<int>(c.y));
        }
        if (tried >= kTried || fitted_.size() >= kEnough) continue;
        ++tried;
        if (fit_tag(picture, tag, kFewPixels)) {
            unbend_tag(follower_.camera(), tag);
            fitted_.push_back(tag);
        }
    }
    // Otherwise the camera or the board has moved, or most of it is hidden.
    constexpr std::size_t kHeld = 4;
    constexpr int kMoved = 40;  // pixels
    if (fitted_.size() >= kHeld || tried < static_cast<int>(kHeld)) return;
    detector_.read(picture,
                   {around.x0 - kMoved, around.y0 - kMoved, around.x1 + kMoved, around.y1 + kMoved},
                   kSearchStep, raw_);
}

void PictureFollower::look_at_tool(const GreyPicture& picture,
                                   MarkerRole role,
                                   const Rigid& camera_from_body) {
    constexpr double kMargin = 30;     // pixels: what a hand does beside going on as it did
    constexpr int kSmall = 160 * 160;  // pixels: every one of them is looked at
    double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
    for (const MarkerFace& face : follower_.body(role)->faces)
        for (const Point3& corner : face.corners) {
            Pixel p;
            if (!project(follower_.camera(), camera_from_body * corner - Point3{}, p, nullptr))
                return;
            x0 = std::min(x0, p.x), x1 = std::max(x1, p.x);
            y0 = std::min(y0, p.y), y1 = std::max(y1, p.y);
        }
    if (!(x1 > 0 && y1 > 0 && x0 < picture.width_px && y0 < picture.height_px)) return;
    const auto clamped = [](double at, int high) {
        return static_cast<int>(std::clamp(at, 0.0, static_cast<double>(high)));
    };
    const PictureRegion region{
        clamped(x0 - kMargin, picture.width_px), clamped(y0 - kMargin, picture.height_px),
        clamped(x1 + kMargin, picture.width_px), clamped(y1 + kMargin, picture.height_px)};
    const int area = (region.x1 - region.x0) * (region.y1 - region.y0);
    detector_.read(picture, region, area <= kSmall ? 1 : kFindStep, raw_);
}

bool PictureFollower::seen(MarkerRole role, int tags) const {
    const MarkerBody* body = follower_.body(role);
    for (const std::vector<SeenTag>* list : {&raw_, &fitted_})
        for (const SeenTag& tag : *list)
            for (const MarkerTag& drawn : body->tags) tags -= drawn.id == tag.id;
    return tags <= 0;
}

// A tag that is in view twice need not be so within one searched part: it then seems to leap.
void PictureFollower::note_twice() {
    constexpr std::int64_t kRemembered = 15, kLeapPictures = 4;
    constexpr double kLeapPx = 80;  // in one picture; a body that is moved at 1 m/s at 0.4 m
    for (const int id : twice_)
        if (id < kMarkerTagIds) twice_until_[id] = picture_ + kRemembered;
    for (const SeenTag& tag : raw_) {
        // A board is laid over the picture where it was; a second one shows beside it.
        const TagPlace bearer = find_tag(follower_.bodies(), tag.id);
        if (bearer.body < 0 || follower_.bodies()[bearer.body].role == MarkerRole::board) continue;
        Place& place = places_[tag.id];
        const Pixel middle = middle_of(tag);
        const std::int64_t age = picture_ - place.picture;
        if (age <= kLeapPictures && way(place.middle, middle) > kLeapPx * static_cast<double>(age))
            twice_until_[tag.id] = picture_ + kRemembered;
        place = {middle, picture_};
    }
    for (int id = 0; id < kMarkerTagIds; ++id)
        if (twice_until_[id] >= picture_ && !std::binary_search(twice_.begin(), twice_.end(), id))
            twice_.insert(std::lower_bound(twice_.begin(), twice_.end(), id), id);
}

FollowerPicture PictureFollower::follow(const GreyPicture& picture, double time_s) {
    constexpr MarkerRole kTools[] = {MarkerRole::probe, MarkerRole::needle};
    constexpr int kSearchEvery = 4;                   // pictures, while everything is in view
    constexpr int kEnoughTags = 2;                    // of a body
    constexpr int kOverlap = 40;                      // pixels: by which parts overlap
    constexpr int kFineParts = 6, kFineOverlap = 20;  // large tags are found at large steps
    constexpr int kLongMissing = 30;                  // pictures
    constexpr double kPauseS = 0.15;                  // where a tool is by then is not known
    ++picture_;
    const bool begins = time_s - last_s_ > kPauseS;
    last_s_ = time_s;
    if (begins) places_ = {};
    raw_.clear(), fitted_.clear(), twice_.clear();
    look_at_board(picture);
    bool missing = follower_.body(MarkerRole::board) && !seen(MarkerRole::board, 3);
    bool missed[2] = {};
    for (int t = 0; t < 2; ++t) {
        if (!follower_.body(kTools[t])) continue;
        if (const std::optional<Rigid> pose = follower_.expected(kTools[t], time_s))
            look_at_tool(picture, kTools[t], *pose);
        missed[t] = !seen(kTools[t], kEnoughTags);
        missing = missing || missed[t];
    }
    bool lately = !missing || begins;  // something that was in view a second ago is missing
    for (int t = 0; t < 2; ++t) {
        missed_for_[t] = missed[t] ? missed_for_[t] + 1 : 0;
        lately = lately || (missed[t] && missed_for_[t] < kLongMissing);
    }
    if (begins) {
        detector_.read(picture, whole(picture), kFindStep, raw_);
        foreign_ = {};
        for (const SeenTag& tag : raw_)
            foreign_[0] += find_tag(follower_.bodies(), tag.id).body < 0;
    } else if (missing || picture_ % kSearchEvery == 0) {
        // A third at large steps. What has been missing for long may be too far away for these:
        // then sixths at small steps follow.
        const int round = lately ? 0 : static_cast<int>(picture_ % (kParts + kFineParts));
        const bool fine = round >= kParts;
        if (!fine) part_ = (part_ + 1) % kParts;
        const int index = fine ? round - kParts : part_, parts = fine ? kFineParts : kParts;
        const int overlap = fine ? kFineOverlap : kOverlap;
        const PictureRegion part{0, picture.height_px * index / parts - overlap, picture.width_px,
                                 picture.height_px * (index + 1) / parts + overlap};
        const std::size_t before = raw_.size();
        detector_.read(picture, part, fine ? kFindStep : kSearchStep, raw_);
        int foreign = 0;
        for (std::size_t k = before; k < raw_.size(); ++k)
            foreign += find_tag(follower_.bodies(), raw_[k].id).body < 0;
        if (!fine) foreign_[part_] = foreign;
        // The first tag of a body shows where to look more closely.
        for (int t = 0; t < 2; ++t) {
            if (!missed[t]) continue;
            PictureRegion around{picture.width_px, picture.height_px, 0, 0};
            for (std::size_t k = before; k < raw_.size(); ++k) {
                const TagPlace place = find_tag(follower_.bodies(), raw_[k].id);
                if (place.body < 0 || follower_.bodies()[place.body].role != kTools[t]) continue;
                const Pixel middle = middle_of(raw_[k]);
                const double reach = 2.5 * diagonal_of(raw_[k]) + 10;
                around.x0 = std::min(around.x0, static_cast<int>(middle.x - reach));
                around.y0 = std::min(around.y0, static_cast<int>(middle.y - reach));
                around.x1 = std::max(around.x1, static_cast<int>(middle.x + reach));
                around.y1 = std::max(around.y1, static_cast<int>(middle.y + reach));
            }
            if (around.x1 > 0) detector_.read(picture, around, kFindStep, raw_);
        }
    }
    any_tags_ = !raw_.empty() || !fitted_.empty();
    // Those that are laid over the picture already come first, and stay.
    const std::size_t laid = fitted_.size();
    std::vector<SeenTag> all(fitted_);
    all.insert(all.end(), raw_.begin(), raw_.end());
    sort_by_id(all, twice_);
    raw_ = all;
    note_twice();
    constexpr std::size_t kBoardTags = 8;
    std::size_t board_tags = laid;
    for (const int index : board_order_) {
        if (board_tags >= kBoardTags) break;
        const int id = follower_.body(MarkerRole::board)->tags[index].id;
        for (SeenTag& tag : raw_)
            if (tag.id == id && tag.contrast == 0 && fit_tag(picture, tag, 250)) {
                unbend_tag(follower_.camera(), tag);
                fitted_.push_back(tag);
                ++board_tags;
            }
    }
    for (SeenTag& tag : raw_) {
        const TagPlace place = find_tag(follower_.bodies(), tag.id);
        if (place.body < 0 || follower_.bodies()[place.body].role == MarkerRole::board) continue;
        if (std::binary_search(twice_.begin(), twice_.end(), tag.id)) continue;
        if (!fit_tag(picture, tag)) continue;
        unbend_tag(follower_.camera(), tag);
        fitted_.push_back(tag);
    }
    return follower_.follow(fitted_, twice_, std::accumulate(foreign_.begin(), foreign_.end(), 0),
                            time_s);
}

}  // namespace sonocase
