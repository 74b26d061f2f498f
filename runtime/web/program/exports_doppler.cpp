// SPDX-License-Identifier: Apache-2.0

// What the page calls for the Doppler modes.
#include <algorithm>

#include "runtime/imaging/doppler/doppler_colours.h"
#include "runtime/web/program/page_state.h"

using namespace sonocase;
using namespace sonocase::runtime;

namespace {

// Order of doppler(); page/core.js names them in the same order.
void fill_doppler(const DopplerSettings& d) {
    page.doppler = {double(d.mode),  d.box_left,       d.box_right,   d.box_top_mm,
                    d.box_bottom_mm, d.steer_deg,      d.scale_cm_s,  d.spectral_scale_cm_s,
                    d.baseline,      double(d.invert), d.wall_filter, d.gain_db,
                    d.gate_line,     d.gate_depth_mm,  d.gate_mm,     d.angle_deg};
}

DopplerSettings settings_of(const std::array<double, 16>& from) {
    DopplerSettings d;
    d.mode = static_cast<DopplerMode>(std::clamp(static_cast<int>(from[0]), 0, 4));
    d.box_left = from[1];
    d.box_right = from[2];
    d.box_top_mm = from[3];
    d.box_bottom_mm = from[4];
    d.steer_deg = from[5];
    d.scale_cm_s = from[6];
    d.spectral_scale_cm_s = from[7];
    d.baseline = from[8];
    d.invert = from[9] != 0;
    d.wall_filter = from[10];
    d.gain_db = from[11];
    d.gate_line = from[12];
    d.gate_depth_mm = from[13];
    d.gate_mm = from[14];
    d.angle_deg = from[15];
    return d;
}

int put_points(std::span<const PlanePoint> points) {
    page.numbers.clear();
    for (const PlanePoint p : points) page.numbers.insert(page.numbers.end(), {p.x, p.z});
    return static_cast<int>(points.size());
}

}  // namespace

// The settings: read here, and written here before set_doppler().
SONOCASE_EXPORT(doppler) double* doppler_settings() {
    fill_doppler(page.settings.doppler);
    return page.doppler.data();
}
SONOCASE_EXPORT(set_doppler) int set_doppler() {
    const DopplerSettings wanted = settings_of(page.doppler);
    if (wanted.mode != DopplerMode::off)
        if (const Status begun = page.player->begin_doppler(); !begun) return answer(begun);
    page.settings.doppler = wanted;
    return 1;
}
// Box and gate to the widest vessel of the plane. 0: it cuts none.
SONOCASE_EXPORT(aim_doppler) int aim_doppler() {
    DopplerSettings& settings = page.settings.doppler;
    const DopplerSettings aimed = page.player->doppler().aimed(page.player->engine(), settings);
    const bool moved = !(aimed == settings);
    settings = aimed;
    return moved;
}
// A linear probe's lines can be steered.
SONOCASE_EXPORT(steers) int steers() {
    return !doppler_geometry(page.player->engine()).fan;
}
// What a pointer takes hold of at a place of the scan plane, as doppler::Held.
SONOCASE_EXPORT(hold_doppler) int hold_doppler(double x_mm, double z_mm, double reach_mm) {
    return static_cast<int>(doppler::hold_at(doppler_geometry(page.player->engine()),
                                             page.settings.doppler, {x_mm, z_mm}, reach_mm));
}
SONOCASE_EXPORT(drag_doppler)
void drag_doppler(int held, double from_x, double from_z, double to_x, double to_z) {
    doppler::drag_held(doppler_geometry(page.player->engine()), static_cast<doppler::Held>(held),
                       {from_x, from_z}, {to_x, to_z}, page.settings.doppler);
}
// Two numbers for each point at numbers(): the box's outline, or face, end, upper, lower and middle
// of the gate.
SONOCASE_EXPORT(doppler_marks) int doppler_marks() {
    const ScanGeometry geometry = doppler_geometry(page.player->engine());
    const DopplerSettings& settings = page.settings.doppler;
    if (settings.mode == DopplerMode::colour || settings.mode == DopplerMode::power)
        return put_points(doppler::box_outline(geometry, settings));
    const doppler::GateMarks gate = doppler::gate_marks(geometry, settings);
    return put_points(std::array{gate.face, gate.end, gate.upper, gate.lower, gate.middle});
}

// Null: the last picture is grey.
SONOCASE_EXPORT(overlay) const std::uint8_t* overlay() {
    return page.player->doppler().overlay().data();
}
// 256 times red, green, blue.
SONOCASE_EXPORT(palette) const std::uint8_t* palette(int power) {
    return doppler::palette(power ? DopplerMode::power : DopplerMode::colour)[0].data();
}
// Null: the mode has none.
SONOCASE_EXPORT(strip) const std::uint8_t* strip(int width, int height) {
    return page.player->doppler().strip(width, height).data();
}
// Pairs of samples at sound().
SONOCASE_EXPORT(sound_count) std::size_t sound_count() {
    return page.player->doppler().sound().size() / 2;
}
SONOCASE_EXPORT(sound) const float* sound() {
    return page.player->doppler().sound().data();
}
