// SPDX-License-Identifier: Apache-2.0

// Stiffness, drainage and puncture force of a label. A recipe's figures come first; then the
// built-in table, by the name of the tissue; then the kind of the tissue, so that bundles without
// such figures (all that were cooked before tissue yielded) can be pressed as well.
//
// Blood is a vein, an artery or a thrombus by the name of its label: veins drain and close under
// light pressure, arteries stay round, a thrombosed vein does not close. A vessel that says neither
// counts as an artery, since one that stays open misleads nobody about a thrombosis.
//
// Young's moduli in kPa at small strain, across the fibres; forces for an 18 G needle. Sources are
// beside the figures in tissue_mechanics.cpp; "(a)" marks an assumed one.
#pragma once

#include <string_view>

#include "formats/volume/tissue.h"

namespace sonocase {

// Cost: some string comparisons; meant for when a scene is opened.
TissueMechanics mechanics_of(const Tissue& tissue, std::string_view label_name);

// The same without a recipe's figures.
TissueMechanics built_in_mechanics(const Tissue& tissue, std::string_view label_name);

enum class Vessel { unknown, vein, artery, thrombus };

// By whole words of the name, whatever their case: vein, vena, cava, venous, portal; artery, aorta,
// carotid, trunk; thrombus, thrombosed, thrombosis.
Vessel vessel_of_label(std::string_view label_name);

}  // namespace sonocase
