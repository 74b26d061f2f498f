// SPDX-License-Identifier: Apache-2.0

#include "formats/machine/machine.h"

#include <optional>

#include "formats/text/nearest_name.h"
#include "formats/text/number_text.h"
#include "formats/text/toml_reader.h"

namespace sonocase {
namespace {

const std::vector<std::string>& map_names() {  // in the order of GreyMap
    static const std::vector<std::string> names{"power", "log"};
    return names;
}

// The one list of tables, keys and limits: the reader and the writer both walk it. M is Machine or
// const Machine; V has table(), number(), whole(), flag(), choice().
template <class M, class V>
void visit_machine(M& m, V& v) {
    v.table("beam");
    v.number("frequency_mhz", m.beam.frequency_mhz, 0.5, 50, true);
    v.number("reference_mhz", m.beam.reference_mhz, 0.5, 50);
    v.number("axial_mm", m.beam.axial_mm, 0.01, 10, true);
    v.number("lateral_mm", m.beam.lateral_mm, 0.01, 20, true);
    v.number("lateral_focus_mm", m.beam.lateral_focus_mm, 1, 500, true);
    v.number("lateral_range_mm", m.beam.lateral_range_mm, 1, 1e4);
    v.number("skirt", m.beam.skirt, 0, 4);
    v.number("skirt_width", m.beam.skirt_width, 1, 10);
    v.number("elevation_mm", m.beam.elevation_mm, 0.01, 50, true);
    v.number("aperture_mm", m.beam.aperture_mm, 0, 100);
    v.whole("lines", m.beam.lines, 16, 1024);
    v.table("looks");
    v.whole("count", m.looks.count, 1, 16);
    v.whole("near_count", m.looks.near_count, 1, 16);
    v.number("near_mm", m.looks.near_mm, 0, 500);
    v.table("grey");
    v.choice("map", m.grey.map, map_names());
    v.number("floor", m.grey.floor, 0, 255);
    v.number("level", m.grey.level, 1, 255);
    v.number("exponent", m.grey.exponent, 0.05, 4);
    v.number("knee", m.grey.knee, 1, 255);
    v.number("knee_slope", m.grey.knee_slope, 0, 1);
    v.number("dynamic_range_db", m.grey.dynamic_range_db, 20, 120);
    v.table("noise");
    v.number("level_db", m.noise.level_db, -200, 20);
    v.flag("reject", m.noise.reject);
    v.number("grain_db", m.noise.grain_db, 0, 3);
    v.table("gain");
    v.number("tgc_db_per_cm_mhz", m.gain.tgc_db_per_cm_mhz, 0, 3);
    v.number("far_from_mm", m.gain.far_from_mm, 0, 500);
    v.number("far_db_per_cm", m.gain.far_db_per_cm, 0, 30);
    v.number("far_limit_db", m.gain.far_limit_db, 0, 120);
    v.table("near_field");
    v.number("ring_level", m.near_field.ring_level, 0, 100);
    v.number("ring_decay_mm", m.near_field.ring_decay_mm, 0.1, 100);
    v.number("tail_level", m.near_field.tail_level, 0, 100);
    v.number("tail_decay_mm", m.near_field.tail_decay_mm, 0.1, 100);
    v.whole("lines", m.near_field.lines, 0, 32);
    v.number("first_mm", m.near_field.first_mm, 0, 50);
    v.number("spacing_mm", m.near_field.spacing_mm, 0.1, 50);
    v.number("line_db", m.near_field.line_db, -60, 60);
    v.number("line_step_db", m.near_field.line_step_db, 0, 60);
    v.number("line_mm", m.near_field.line_mm, 0.05, 20);
    v.number("start", m.near_field.start, 0, 1);
    v.number("start_mm", m.near_field.start_mm, 0.1, 50);
    v.table("haze");
    v.number("fraction", m.haze.fraction, 0, 10);
    v.number("decay_mm", m.haze.decay_mm, 0.1, 100);
    v.number("across_mm", m.haze.across_mm, 0, 50);
    v.number("side_lobe_db", m.haze.side_lobe_db, -120, 0);
    v.table("contact");
    v.number("edge_db", m.contact.edge_db, 0, 120);
    v.number("edge_fraction", m.contact.edge_fraction, 0, 0.5);
    v.table("equalisation");
    v.number("amount", m.equalisation.amount, 0, 1);
    v.number("from_mm", m.equalisation.from_mm, 0, 500);
    v.table("speckle_reduction");
    v.number("variation", m.speckle_reduction.variation, 0, 1);
    v.number("from_mm", m.speckle_reduction.from_mm, 0, 500);
    v.table("structures");
    v.flag("parenchyma", m.structures.parenchyma);
    v.flag("streaks", m.structures.streaks);
    v.flag("diaphragm", m.structures.diaphragm);
    v.flag("wall", m.structures.wall);
    v.flag("linings", m.structures.linings);
}

class Reader {
  public:
    explicit Reader(const TomlTable& machine) : machine_(machine), at_(std::nullopt) {}

    void table(const char* name) {
        finish();
        at_ = machine_.table(name);
    }
    void finish() {
        if (at_) at_->finish();
    }
    void number(const char* key, double& to, double low, double high, bool or_zero = false) {
        if (!at_) return;
        double value = 0;
        if (!at_->number(key, value, or_zero ? 0 : low, high)) return;
        if (or_zero && value != 0 && value < low) {
            at_->add_fault(key, "is " + number_text(value, 6) + ", out of range",
                           "expected 0, or a number from " + number_text(low, 6) + " to " +
                               number_text(high, 6));
            return;
        }
        to = value;
    }
    void whole(const char* key, int& to, int low, int high) {
        if (at_) at_->whole(key, to, low, high);
    }
    void flag(const char* key, bool& to) {
        if (at_) at_->flag(key, to);
    }
    void choice(const char* key, GreyMap& to, const std::vector<std::string>& names) {
        if (!at_) return;
        if (const auto index = at_->choice(key, names)) to = static_cast<GreyMap>(*index);
    }

  private:
    const TomlTable& machine_;
    std::optional<TomlTable> at_;
};

std::string quoted(const std::string& text) {
    static constexpr char kHex[] = "0123456789ABCDEF";
    std::string out = "\"";
    for (const char c : text) {
        const auto code = static_cast<unsigned char>(c);
        if (c == '"' || c == '\\') {
            out += '\\';
            out += c;
        } else if (code < 32 || code == 127) {
            out += "\\u00";
            out += kHex[code >> 4];
            out += kHex[code & 15];
        } else {
            out += c;
        }
    }
    return out + '"';
}

class Writer {
  public:
    std::string text;

    void line(const std::string& key, const std::string& value) {
        text += key + " = " + value + '\n';
    }
    void table(const char* name) { text += std::string("\n[machine.") + name + "]\n"; }
    void number(const char* key, double value, double, double, bool = false) {
        line(key, number_text(value));
    }
    void whole(const char* key, int value, int, int) { line(key, std::to_string(value)); }
    void flag(const char* key, bool value) { line(key, value ? "true" : "false"); }
    void choice(const char* key, GreyMap value, const std::vector<std::string>& names) {
        line(key, quoted(names[static_cast<std::size_t>(value)]));
    }
};

Machine read_machine(const TomlTable& table) {
    std::string base = "modern";
    table.text("base", base, machine_names());
    Machine m = *built_in_machine(base);
    table.text("name", m.name);
    if (m.name.empty()) table.add_fault("name", "is empty", "expected a short name");
    table.text("title", m.title);
    table.numbers("persistence", m.persistence, 0, 1, 1, 8);
    if (!(m.persistence.front() > 0)) {
        table.add_fault("persistence", "gives the newest frame no weight",
                        "expected a first weight above 0");
    }
    table.number("edge_enhancement", m.edge_enhancement, 0, 4);
    table.flag("post_filter", m.post_filter);
    Reader reader(table);
    visit_machine(m, reader);
    reader.finish();
    if (const auto tissue = table.table("tissue_db")) {
        for (const std::string& label : tissue->keys()) {
            double level_db = 0;
            if (tissue->number(label, level_db, -60, 60)) m.tissue_db[label] = level_db;
        }
    }
    table.finish();
    return m;
}

}  // namespace

Result<Machine> parse_machine(std::string_view toml, const std::string& where) {
    SONOCASE_TRY(const auto root, TomlTable::parse(toml, where));
    const auto table = root.table("machine");
    if (!table && !root.fault()) {
        root.add_fault("machine", "is missing", "expected the table [machine]");
    }
    Machine machine;
    if (table) machine = read_machine(*table);
    root.finish();
    if (root.fault()) return *root.fault();
    return machine;
}

std::string machine_toml(const Machine& m) {
    Writer writer;
    writer.text = "[machine]\n";
    writer.line("name", quoted(m.name));
    writer.line("title", quoted(m.title));
    std::string weights;
    for (const double weight : m.persistence)
        weights += (weights.empty() ? "" : ", ") + number_text(weight);
    writer.line("persistence", "[" + weights + "]");
    writer.line("edge_enhancement", number_text(m.edge_enhancement));
    writer.flag("post_filter", m.post_filter);
    visit_machine(m, writer);
    writer.table("tissue_db");
    for (const auto& [label, level_db] : m.tissue_db)
        writer.line(quoted(label), number_text(level_db));
    return writer.text;
}

namespace {

// A machine of the nineties: no compounding, logarithmic grey, point spread from the frequency
// alone.
Machine classic() {
    Machine m;
    m.name = "classic";
    m.title = "Classic scanner, single look, logarithmic grey";
    m.beam.axial_mm = m.beam.lateral_mm = 0;
    m.beam.lateral_focus_mm = 0;
    m.beam.skirt = 0;
    m.beam.aperture_mm = 0;
    m.beam.lines = 192;
    m.looks = {1, 1, 0};
    m.grey = {.map = GreyMap::log,
              .floor = 0,
              .level = 131.5,
              .exponent = 1,
              .knee = 255,
              .knee_slope = 1,
              .dynamic_range_db = 60};
    m.noise = {-70, false};
    m.gain = {0, 500, 0, 0};
    m.near_field = {.ring_level = 1.6,
                    .ring_decay_mm = 2.2,
                    .tail_level = 0.3,
                    .tail_decay_mm = 9,
                    .lines = 0,
                    .first_mm = 0.5,
                    .spacing_mm = 1.9,
                    .line_db = 0,
                    .line_step_db = 0,
                    .line_mm = 0.8,
                    .start = 1,
                    .start_mm = 3};
    m.haze = {0, 4.5, 2, -24};
    m.contact = {0, 0};
    m.equalisation.amount = 0;
    m.speckle_reduction.variation = 0;
    m.structures = {
        .parenchyma = false, .streaks = false, .diaphragm = false, .wall = false, .linings = false};
    m.post_filter = true;
    return m;
}

// Widths and depths of a small-parts probe; grain and depth profile of the usgra-seg images
// (Mindray TE7, L14-6Ns, CC BY 4.0), whose scale of 38 mm per face is an assumption.
Machine modern_linear() {
    Machine m;
    m.name = "modern-linear";
    m.title = "Modern scanner, linear probe";
    m.beam.reference_mhz = 9;
    m.beam.axial_mm = 0.23;
    m.beam.lateral_mm = 0.22;
    m.beam.lateral_focus_mm = 20;
    m.beam.lateral_range_mm = 25;
    m.beam.skirt = 1;
    m.beam.skirt_width = 5.2;
    m.beam.aperture_mm = 0;
    m.beam.lines = 192;
    m.looks = {4, 5, 8};
    m.grey.floor = 3;
    m.grey.level = 76;
    m.grey.exponent = 0.6;
    m.noise.grain_db = 1.3;
    m.gain = {0, 11, 3.5, 12};
    m.near_field = {.ring_level = 1,
                    .ring_decay_mm = 0.9,
                    .tail_level = 0,
                    .tail_decay_mm = 9,
                    .lines = 3,
                    .first_mm = 0.3,
                    .spacing_mm = 0.8,
                    .line_db = 4,
                    .line_step_db = 2.2,
                    .line_mm = 0.35,
                    .start = 0.5,
                    .start_mm = 1.5};
    m.haze = {0.2, 1.6, 0.8, -120};
    m.contact = {6, 0.05};
    m.equalisation.amount = 0;
    m.speckle_reduction.variation = 0;
    return m;
}

}  // namespace

std::vector<std::string> machine_names() {
    return {"classic", "modern", "modern-linear"};
}

Result<Machine> built_in_machine(std::string_view name) {
    if (name == "classic") return classic();
    if (name == "modern") return Machine{};
    if (name == "modern-linear") return modern_linear();
    return Error{"no machine is called '" + std::string(name) + "'", "",
                 suggest_name(name, machine_names())};
}

}  // namespace sonocase
