// SPDX-License-Identifier: Apache-2.0

// sonocase map: carries points through a fitted map, either way, each with a status.
#include <CLI/CLI.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "formats/files/atomic_file.h"
#include "formats/text/number_text.h"
#include "pipeline/base/parallel.h"
#include "pipeline/base/point_table.h"
#include "pipeline/registration/map/inverse_map.h"
#include "pipeline/registration/map/registration.h"
#include "pipeline/verbs/verb_common.h"
#include "pipeline/verbs/verbs.h"

namespace sonocase::pipeline::inline verbs {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Rows without a position become NaN, so that the output has the same rows as the input.
Result<std::vector<Point3>> read_points(const std::string& path) {
    SONOCASE_TRY(auto table, load_point_table(path, {.names = true, .keep_holes = true}));
    place_points(table, 1, Axes::unsaid);
    return std::move(table.points);
}

const char* status_name(MapStatus status) {
    return status == MapStatus::ok        ? "ok"
           : status == MapStatus::outside ? "outside"
                                          : "no_preimage";
}

bool is_finite(Point3 p) {
    return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

}  // namespace

int verb_map(int argc, char** argv) {
    CLI::App app(
        "Carry points through a fitted map. Status ok: inside the CT; outside: the point or its "
        "image is beyond the CT, where nothing is proven; no_preimage: nothing maps onto the "
        "point");
    std::string registration_path, from, to, in, out;
    CommonOptions common;
    app.add_option("registration", registration_path, "What register wrote")
        ->type_name("REG.json")
        ->required();
    const CLI::IsMember frame({"ct", "mannequin"});
    app.add_option("--from", from, "Frame of the points")->check(frame)->required();
    app.add_option("--to", to, "Frame to carry them to")->check(frame)->required();
    app.add_option("--points", in, "Points x,y,z in mm")->type_name("IN.csv")->required();
    app.add_option("-o,--output", out, "Rows x,y,z,status")->type_name("OUT.csv")->required();
    add_common_options(app, common);
    if (const auto status = parse_command_line(app, argc, argv)) return *status;
    const ThreadLimit limit(common.threads);
    const Stopwatch watch;
    const Result<Registration> registration = load_registration(registration_path);
    if (!registration) return fail("map", registration.error());
    const Result<std::vector<Point3>> points = read_points(in);
    if (!points) return fail("map", points.error());

    std::vector<Point3> mapped(points->size(), Point3{kNan, kNan, kNan});
    std::vector<MapStatus> status(points->size(), MapStatus::no_preimage);
    if (from == "mannequin" && to == "ct") {
        const InverseMap inverse(*registration);
        parallel_for(points->size(), 256, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i)
                status[i] = inverse.invert((*points)[i], &mapped[i]);
        });
    } else {
        for (std::size_t i = 0; i < points->size(); ++i) {
            const Point3 p = (*points)[i];
            if (!is_finite(p)) continue;
            mapped[i] = from == to ? p : mannequin_from_ct(*registration, p);
            const bool inside = (from == "mannequin") || registration->ct_box.empty() ||
                                registration->ct_box.contains(p);
            status[i] = inside ? MapStatus::ok : MapStatus::outside;
        }
    }
    StageReport report;
    report.stage = "map";
    double counts[3] = {0, 0, 0};
    std::string csv = "x,y,z,status\n";
    for (std::size_t i = 0; i < mapped.size(); ++i) {
        for (int axis = 0; axis < 3; ++axis) csv += number_text(mapped[i][axis]) + ",";
        csv += status_name(status[i]);
        csv += '\n';
        ++counts[static_cast<std::size_t>(status[i])];
    }
    if (auto s = write_file(out, csv); !s) return fail("map", s.error());
    report.measures = {{"points", static_cast<double>(mapped.size())},
                       {"ok", counts[0]},
                       {"outside", counts[1]},
                       {"no_preimage", counts[2]}};
    report.seconds = watch.seconds();
    if (auto s = write_report(common, report); !s) return fail("map", s.error());
    return kDone;
}

}  // namespace sonocase::pipeline::inline verbs
