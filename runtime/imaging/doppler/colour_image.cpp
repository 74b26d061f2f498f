// SPDX-License-Identifier: Apache-2.0

#include "runtime/imaging/doppler/colour_image.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "formats/base/constants.h"

namespace sonocase::runtime::doppler {
namespace {

constexpr float kShadowMm = 2;
// Point spread over cells, standard deviations 0.8 and 1.2, normalised.
constexpr std::array<float, 3> kAcross{0.4917f, 0.2251f, 0.0290f};
constexpr std::array<float, 4> kAlong{0.3330f, 0.2353f, 0.0830f, 0.0152f};

float power_of(double db) {
    return static_cast<float>(std::pow(10.0, db / 10));
}

}  // namespace

double colour_frame_hz(const ColourBox& box,
                       const DopplerSettings& settings,
                       double frequency_mhz,
                       double depth_mm,
                       int grey_lines) {
    const double nyquist = 10 * setting_within(settings.scale_cm_s, 1, 500, 30);
    const double prf = 4 * frequency_mhz * 1e6 * nyquist / kSpeedOfSoundMmPerS;
    const double grey_s = grey_lines * 2 * depth_mm / kSpeedOfSoundMmPerS;
    const double colour_s = box.lines * std::clamp(settings.ensemble, 4, kMaxPulses) / prf;
    return 1 / (grey_s + colour_s);
}

ColourImage::ColourImage(const FlowScene& scene,
                         const ScanGeometry& geometry,
                         double frequency_mhz,
                         double focus_mm)
    : scene_(scene),
      geometry_(geometry),
      frequency_mhz_(frequency_mhz),
      pixels_(geometry),
      blood_(scene) {
    const std::size_t cells = kStride * (kColourRows + 2 * kMargin);
    for (auto* plane : {&power_, &re_, &im_, &work_, &truth_, &turns_, &shown_power_})
        plane->assign(cells, 0.0f);
    zeros_.assign(kStride, 0.0f);
    is_blood_.assign(cells, 0);
    vessel_.assign(cells, -1);
    cells_of_.assign(scene.vessels(), 0);
    shown_of_ = cells_of_;
    index_.assign(cells, 0);
    no_colour_.assign(kStride, 0);
    // No slot holds a frame yet: each is marked with a frame that it can never hold.
    draws_.resize(kColourLines * kColourRows);
    for (CellDraws& cell : draws_)
        for (std::uint64_t slot = 0; slot < kMaxPersisted; ++slot) cell.whose[slot] = slot + 1;
    for (int row = 0; row < kColourRows; ++row) {
        const double beyond = (row + 0.5) * geometry.depth_mm / kColourRows - focus_mm;
        const double loss = kSignalLoss * frequency_mhz * 2 * beyond / 10;
        noise_.push_back(power_of(kNoiseDb + std::clamp(loss, -6.0, 40.0)));
    }
    shadow_row_.assign(kColourLines, 0.0f);
    row_active_.assign(kColourRows, 0);
    const std::size_t across = kColourLines / kBlockLines + 2, down = kColourRows / kBlockRows + 2;
    blocks_.reserve(across * down);
    nodes_.resize((across + 1) * (down + 1));
    node_direction_.resize(nodes_.size());
    node_tissue_.resize(nodes_.size());
    box_capsules_.resize(scene.capsules().size());
    block_capsules_.resize(scene.capsules().size());
}

// Rest places at the corners of blocks; cells interpolate between them.
void ColourImage::find_rest(const TissuePlace& place) {
    blocks_.clear();
    const int across = (box_.lines + kBlockLines - 1) / kBlockLines,
              down = (box_.rows + kBlockRows - 1) / kBlockRows;
    const Rigid pose = place.mannequin_from_probe();
    for (int k = 0; k <= down; ++k)
        for (int l = 0; l <= across; ++l) {
            const double line = box_.first_line + std::min(l * kBlockLines, box_.lines) - 0.5,
                         row = box_.first_row + std::min(k * kBlockRows, box_.rows) - 0.5;
            const int n = k * (across + 1) + l;
            nodes_[n] = scene_.local(place.rest(box_.point(line, row)));
            const PlanePoint d = box_.direction(line);
            const Vector3 world = pose.rotation * Vector3{d.x, 0, d.z};
            node_direction_[n] = {static_cast<float>(world.x), static_cast<float>(world.y),
                                  static_cast<float>(world.z)};
        }
    for (int k = 0; k < down; ++k)
        for (int l = 0; l < across; ++l)
            blocks_.push_back({l * kBlockLines, k * kBlockRows,
                               std::min(kBlockLines, box_.lines - l * kBlockLines),
                               std::min(kBlockRows, box_.rows - k * kBlockRows), false, false});
}

// Finds for each line the depth at which bone or gas stops the beam; every second line is searched,
// in steps of kShadowMm.
void ColourImage::find_shadow(const TissuePlace& place) {
    const double step = kShadowMm / box_.row_mm;
    const int last = box_.first_row + box_.rows;
    for (int l = 0; l < box_.lines; l += 2) {
        float row = static_cast<float>(last);
        const ColourBox::Beam beam = box_.beam(box_.first_line + l);
        for (double k = 0; k < last; k += step) {
            if (!place.blocks(box_.on(beam, k))) continue;
            row = static_cast<float>(k);
            break;
        }
        shadow_row_[l] = row;
        if (l + 1 < box_.lines) shadow_row_[l + 1] = row;
    }
}

// Whether tissue moves fast enough anywhere for its power behind the filter to be a hundredth of
// what is shown.
bool ColourImage::find_flash(const DopplerSettings& settings, const TissuePlace& place) {
    const int across = (box_.lines + kBlockLines - 1) / kBlockLines,
              down = (box_.rows + kBlockRows - 1) / kBlockRows;
    const double nyquist = 10 * setting_within(settings.scale_cm_s, 1, 500, 30);
    const WallFilter filter(settings.wall_filter);
    const float tissue = power_of(kTissueDb), min_power = 0.01f * power_of(kNoiseDb + kShownDb);
    bool flash = false;
    for (int k = 0; k <= down; ++k)
        for (int l = 0; l <= across; ++l) {
            const double line = box_.first_line + std::min(l * kBlockLines, box_.lines) - 0.5,
                         row = box_.first_row + std::min(k * kBlockRows, box_.rows) - 0.5;
            const int n = k * (across + 1) + l;
            const Vector3 v = place.velocity_mm_s(box_.point(line, row));
            const Float3 d = node_direction_[n];
            const double towards =
                -(v.x * static_cast<double>(d.x) + v.y * static_cast<double>(d.y) +
                  v.z * static_cast<double>(d.z));
            node_tissue_[n] = static_cast<float>(towards / (2 * nyquist));
            const auto sine = static_cast<float>(
                std::abs(unit_circle(static_cast<double>(node_tissue_[n]) / 2).sine));
            flash = flash || tissue * filter.gain(sine) > min_power;
        }
    return flash;
}

// Velocity of the blood at a place along d; false where there is none. place: says whether a vein
// is collapsed there; null: none is.
bool ColourImage::blood_at(Float3 p,
                           std::span<const std::int32_t> among,
                           Float3 d,
                           const TissuePlace* place,
                           float& along,
                           std::int32_t& vessel) {
    const Point3 o = scene_.origin();
    const Point3 rest{o.x + static_cast<double>(p.x), o.y + static_cast<double>(p.y),
                      o.z + static_cast<double>(p.z)};
    if (field_ != nullptr) {
        Vector3 v;
        if (!field_(rest, v)) return false;
        along = dot({static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)}, d);
        return true;
    }
    const FlowHit hit = scene_.find(p, among);
    if (hit.vessel < 0) return false;
    if (place != nullptr && scene_.vein(hit.vessel) && place->closed(rest)) return false;
    along = blood_.speed(hit) * dot(hit.along, d);
    vessel = hit.vessel;
    return true;
}

// Power and lag-one autocorrelation of a block's blood.
void ColourImage::sample_block(Block& block,
                               const DopplerSettings& settings,
                               const TissuePlace& place) {
    const int across = (box_.lines + kBlockLines - 1) / kBlockLines;
    const int n = block.row / kBlockRows * (across + 1) + block.line / kBlockLines;
    const int below = n + across + 1;
    const Float3 c00 = nodes_[n], c10 = nodes_[n + 1], c01 = nodes_[below], c11 = nodes_[below + 1];
    const Float3 middle = 0.25f * ((c00 + c10) + (c01 + c11));
    float reach = 0;
    for (const Float3 c : {c00, c10, c01, c11}) {
        const Float3 d = c - middle;
        reach = std::max(reach, dot(d, d));
    }
    const int near = scene_.near(middle, std::sqrt(reach) + 1, box_capsules_, block_capsules_);
    if (near == 0 && field_ == nullptr) return;
    const auto among = std::span<const std::int32_t>(block_capsules_).first(near);
    const auto nyquist = static_cast<float>(10 * setting_within(settings.scale_cm_s, 1, 500, 30));
    const WallFilter filter(settings.wall_filter);
    const bool presses = place.presses();
    for (int r = 0; r < block.rows; ++r)
        for (int l = 0; l < block.lines; ++l) {
            const int line = block.line + l, row = block.row + r;
            if (static_cast<float>(box_.first_row + row) > shadow_row_[line]) continue;
            const float u = (static_cast<float>(l) + 0.5f) / static_cast<float>(block.lines),
                        v = (static_cast<float>(r) + 0.5f) / static_cast<float>(block.rows);
            const Float3 p = (1 - v) * ((1 - u) * c00 + u * c10) + v * ((1 - u) * c01 + u * c11);
            const Float3 d = (1 - u) * node_direction_[n] + u * node_direction_[n + 1];
            float away = 0;  // velocity along the beam
            std::int32_t vessel = -1;
            if (!blood_at(p, among, d, presses ? &place : nullptr, away, vessel)) continue;
            const float turns = -away / (2 * nyquist);
            const UnitCircle half = unit_circle(static_cast<double>(turns) / 2);
            const auto sine = static_cast<float>(half.sine),
                       cosine = static_cast<float>(half.cosine);
            const float power = filter.gain(std::abs(sine));
            const std::size_t to = at(line, row);
            power_[to] = power;
            re_[to] = power * (cosine * cosine - sine * sine);
            im_[to] = power * (2 * sine * cosine);
            truth_[to] = turns;
            is_blood_[to] = 1;
            vessel_[to] = vessel;
            if (vessel >= 0) ++cells_of_[vessel];
            block.blood = true;
            ++report_.blood_cells;
        }
}

// Tissue is everywhere outside the vessels. Its speckle is not drawn: 40 dB above blood it fills
// the cell wherever it passes the filter at all.
void ColourImage::add_tissue() {
    const int across = (box_.lines + kBlockLines - 1) / kBlockLines;
    const float tissue = power_of(kTissueDb);
    for (Block& block : blocks_) {
        const int n = block.row / kBlockRows * (across + 1) + block.line / kBlockLines;
        const int below = n + across + 1;
        block.active = true;
        for (int r = 0; r < block.rows; ++r)
            for (int l = 0; l < block.lines; ++l) {
                const std::size_t to = at(block.line + l, block.row + r);
                if (is_blood_[to] != 0) continue;
                const float u = (static_cast<float>(l) + 0.5f) / static_cast<float>(block.lines),
                            v = (static_cast<float>(r) + 0.5f) / static_cast<float>(block.rows);
                const float turns =
                    (1 - v) * ((1 - u) * node_tissue_[n] + u * node_tissue_[n + 1]) +
                    v * ((1 - u) * node_tissue_[below] + u * node_tissue_[below + 1]);
                const UnitCircle half = unit_circle(static_cast<double>(turns) / 2);
                const auto sine = static_cast<float>(half.sine),
                           cosine = static_cast<float>(half.cosine);
                const float power = tissue * filter_.gain(std::abs(sine));
                power_[to] = power;
                re_[to] = power * (cosine * cosine - sine * sine);
                im_[to] = power * (2 * sine * cosine);
            }
    }
}

void ColourImage::blur() {
    const int low = -2, high = box_.lines + 2;
    for (auto* plane : {&power_, &re_, &im_}) {
        // Across the lines, row by row, then along them.
        for (int row = 0; row < box_.rows; ++row) {
            if (row_active_[row] == 0) continue;
            const float* from = plane->data() + at(0, row);
            float* to = work_.data() + at(0, row);
            for (int l = low; l < high; ++l)
                to[l] = kAcross[0] * from[l] + kAcross[1] * (from[l - 1] + from[l + 1]) +
                        kAcross[2] * (from[l - 2] + from[l + 2]);
        }
        const auto row_of = [&](int row) {
            const bool active = row >= 0 && row < box_.rows && row_active_[row] != 0;
            return active ? work_.data() + at(0, row) : zeros_.data() + kMargin;
        };
        for (int row = 0; row < box_.rows; ++row) {
            bool any = false;
            for (int k = -3; k <= 3; ++k)
                any = any || (row + k >= 0 && row + k < box_.rows && row_active_[row + k] != 0);
            if (!any) continue;
            const float *a = row_of(row), *b = row_of(row - 1), *c = row_of(row + 1),
                        *d = row_of(row - 2), *e = row_of(row + 2), *f = row_of(row - 3),
                        *g = row_of(row + 3);
            float* to = plane->data() + at(0, row);
            for (int l = 0; l < box_.lines; ++l)
                to[l] = kAlong[0] * a[l] + kAlong[1] * (b[l] + c[l]) + kAlong[2] * (d[l] + e[l]) +
                        kAlong[3] * (f[l] + g[l]);
        }
    }
}

// Clears what the last frame left behind.
void ColourImage::clear() {
    const auto used = static_cast<std::ptrdiff_t>(at(-kMargin, dirty_rows_));
    for (auto* plane : {&power_, &re_, &im_, &truth_})
        std::fill(plane->begin(), plane->begin() + used, 0.0f);
    std::fill(is_blood_.begin(), is_blood_.begin() + used, std::uint8_t{0});
    std::fill(index_.begin(), index_.begin() + used, std::uint8_t{0});
    dirty_rows_ = box_.rows;
}

ColourReport ColourImage::render(const DopplerSettings& settings,
                                 const ColourMoment& moment,
                                 const TissuePlace& place,
                                 std::span<const std::uint8_t> grey,
                                 std::span<std::uint8_t> overlay) {
    assert(overlay.size() == grey.size());
    report_ = {};
    std::fill(overlay.begin(), overlay.end(), std::uint8_t{0});
    box_ = colour_box(geometry_, settings);
    if (box_.empty()) return report_;
    report_.cells = box_.lines * box_.rows;
    report_.frame_hz = colour_frame_hz(box_, settings, frequency_mhz_, geometry_.depth_mm);
    pixels_.steer(box_.steer_tan);
    clear();
    std::fill(cells_of_.begin(), cells_of_.end(), 0);
    std::fill(shown_of_.begin(), shown_of_.end(), 0);
    seed_ = moment.seed;
    filter_ = WallFilter(settings.wall_filter);
    blood_.begin(moment.phase, moment.inspired);
    find_rest(place);
    report_.flash = find_flash(settings, place);
    Float3 middle{}, corner{};
    const int across = (box_.lines + kBlockLines - 1) / kBlockLines,
              down = (box_.rows + kBlockRows - 1) / kBlockRows;
    const auto count = static_cast<std::size_t>((across + 1) * (down + 1));
    for (std::size_t n = 0; n < count; ++n)
        middle = middle + (1 / static_cast<float>(count)) * nodes_[n];
    float reach = 0;
    for (std::size_t n = 0; n < count; ++n) {
        corner = nodes_[n] - middle;
        reach = std::max(reach, dot(corner, corner));
    }
    box_capsules_.resize(scene_.capsules().size());
    const int near = scene_.near(middle, std::sqrt(reach) + 2, scene_.all(), box_capsules_);
    box_capsules_.resize(near);
    const bool blood = near > 0 || field_ != nullptr;
    if (blood) find_shadow(place);
    for (Block& block : blocks_) {
        if (blood) sample_block(block, settings, place);
        block.active = block.blood;
    }
    if (report_.flash) add_tissue();
    std::fill(row_active_.begin(), row_active_.end(), std::uint8_t{0});
    bool any = false;
    for (const Block& block : blocks_)
        for (int r = 0; block.active && r < block.rows; ++r) {
            row_active_[block.row + r] = 1;
            any = true;
        }
    if (any) blur();
    if (any || setting_within(settings.gain_db, -30, 30, 0) > 2) {
        estimate(settings, moment);
        paint(settings, grey, overlay);
    }
    return report_;
}

ColourCell ColourImage::cell(int line, int row) const {
    const std::size_t i = at(line, row);
    return {power_[i],      truth_[i], is_blood_[i] != 0,
            index_[i] != 0, turns_[i], is_blood_[i] != 0 ? vessel_[i] : -1};
}

// The draws of earlier frames that persistence still blends are kept.
inline const float* ColourImage::draws(std::uint32_t cell, std::uint32_t frame) {
    CellDraws& kept = draws_[cell];
    const std::size_t slot = frame % kMaxPersisted;
    float* n = kept.n[slot];
    const std::uint64_t whose = static_cast<std::uint64_t>(seed_) << 32 | frame;
    if (kept.whose[slot] == whose) return n;
    kept.whose[slot] = whose;
    const std::uint32_t key = mixed(cell, seed_ + 0x632BE5ABu * frame);
    for (std::uint32_t q = 0; q < 4; ++q) n[q] = normal(key + q * 0x9E3779B9u);
    return n;
}

void ColourImage::estimate(const DopplerSettings& settings, const ColourMoment& moment) {
    const Ensemble ensemble(settings.ensemble);
    const double gain = setting_within(settings.gain_db, -30, 30, 0);
    const auto shown = static_cast<float>(std::pow(10.0, (kShownDb - gain) / 10)) * ensemble.r0;
    // Below the threshold by more than noise can lift it, nothing is worked out.
    const bool noise_shows = gain > 2;
    const int persistence = std::clamp(settings.persistence, 1, kMaxPersisted);
    const float weight = 1 / std::sqrt(static_cast<float>(persistence));
    const float baseline = static_cast<float>(setting_within(settings.baseline, -0.9, 0.9, 0)) / 2;
    const float full = power_of(12);  // power that is drawn brightest, above the threshold
    for (int row = 0; row < box_.rows; ++row) {
        const float noise = noise_[box_.first_row + row], threshold = shown * noise;
        for (int line = 0; line < box_.lines; ++line) {
            const std::size_t i = at(line, row);
            index_[i] = 0;
            if (power_[i] < 0.02f * noise && !noise_shows) continue;
            const auto cell = static_cast<std::uint32_t>((box_.first_row + row) * kColourLines +
                                                         box_.first_line + line);
            float n[4] = {0, 0, 0, 0};
            for (int k = 0; k < persistence; ++k) {
                const float* drawn = draws(cell, moment.frame - static_cast<std::uint32_t>(k));
                for (int q = 0; q < 4; ++q) n[q] += weight * drawn[q];
            }
            const ColourEstimate found =
                estimate_colour(ensemble, power_[i], re_[i], im_[i], noise, n);
            turns_[i] = found.turns;
            shown_power_[i] = found.power;
            if (!(found.power > threshold)) continue;
            ++report_.shown_cells;
            if (is_blood_[i] != 0 && vessel_[i] >= 0) ++shown_of_[vessel_[i]];
            if (settings.mode == DopplerMode::power) {
                const float part = (found.power - threshold) / (full * threshold);
                index_[i] = static_cast<std::uint8_t>(40 + 215 * std::min(std::sqrt(part), 1.0f));
                continue;
            }
            // A shifted baseline wraps elsewhere.
            float turns = found.turns - baseline;
            turns -= std::floor(turns + 0.5f);
            const float signed_part = (settings.invert ? -turns : turns) * 2;
            const int colour = static_cast<int>(std::lround(128 + 127 * signed_part));
            index_[i] = static_cast<std::uint8_t>(std::clamp(colour, 1, 255));
        }
    }
}

// Bilinear between cells, the shortest way round the circle of velocities. Only pixels that have a
// coloured cell among their four are touched.
void ColourImage::paint(const DopplerSettings& settings,
                        std::span<const std::uint8_t> grey,
                        std::span<std::uint8_t> overlay) const {
    const int priority =
        static_cast<int>(std::lround(255 * setting_within(settings.priority, 0, 1, 0.5)));
    const bool wraps = settings.mode != DopplerMode::power;
    for (int k = -1; k < box_.rows; ++k) {
        if (box_.first_row + k < 0) continue;
        const std::uint8_t *above = k < 0 ? no_colour_.data() : index_.data() + at(-1, k),
                           *below = k + 1 < box_.rows ? index_.data() + at(-1, k + 1)
                                                      : no_colour_.data();
        for (int l = -1; l < box_.lines; ++l) {
            const int i = l + 1;
            const int corner[4] = {above[i], above[i + 1], below[i], below[i + 1]};
            if ((corner[0] | corner[1] | corner[2] | corner[3]) == 0) continue;
            if (box_.first_line + l < 0) continue;
            for (const ColourPixels::Pixel& p :
                 pixels_.of(box_.first_line + l, box_.first_row + k)) {
                if (grey[p.index] > priority) continue;
                const int u = p.line_part, v = p.row_part;
                const int weight[4] = {(256 - u) * (256 - v), u * (256 - v), (256 - u) * v, u * v};
                int covered = 0, sum = 0, first = 0;
                for (int c = 0; c < 4; ++c) {
                    if (corner[c] == 0) continue;
                    if (covered == 0) first = corner[c];
                    int away = corner[c] - first;
                    if (wraps && away > 127) away -= 254;
                    if (wraps && away < -127) away += 254;
                    covered += weight[c];
                    sum += weight[c] * away;
                }
                if (covered < 32768) continue;
                int value = first + sum / covered;
                if (wraps && value > 255) value -= 254;
                if (wraps && value < 1) value += 254;
                overlay[p.index] = static_cast<std::uint8_t>(std::clamp(value, 1, 255));
            }
        }
    }
}

}  // namespace sonocase::runtime::doppler
