"""Conan 2 recipe: conan create packaging/conan [-o aeolid/*:precision=double]."""

import os
import re

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load


class Aeolid(ConanFile):
    """Build the static libraries, and offer the one of the precision that was asked for."""

    name = "aeolid"
    description = "Allocation-free recursive identification filters that stream Markov parameters"
    license = "MIT"
    package_type = "static-library"
    settings = "os", "compiler", "build_type", "arch"
    options = {"precision": ["float", "double"]}
    default_options = {"precision": "float"}
    languages = "C"

    def _root(self):
        return os.path.abspath(os.path.join(self.recipe_folder, "..", ".."))

    def set_version(self):
        text = load(self, os.path.join(self._root(), "include", "aeolid", "aeolid.h"))
        self.version = ".".join(re.findall(r"#define AEO_VERSION_(?:MAJOR|MINOR|PATCH) (\d+)", text))

    def export_sources(self):
        for pattern in ("CMakeLists.txt", "LICENSE", "include/*", "src/*", "port/*", "packaging/*", "tools/aeolid.dbc"):
            copy(self, pattern, self._root(), self.export_sources_folder)

    def layout(self):
        cmake_layout(self)

    def generate(self):
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables["AEOLID_PORTS"] = False
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()

    def package_info(self):
        double = str(self.options.precision) == "double"
        self.cpp_info.libs = ["aeolid_double" if double else "aeolid"]
        self.cpp_info.defines = ["AEO_REAL_DOUBLE"] if double else []
        self.cpp_info.set_property("cmake_file_name", "aeolid")
        self.cpp_info.set_property("cmake_target_name", f"aeolid::{self.cpp_info.libs[0]}")
        self.cpp_info.set_property("pkg_config_name", self.cpp_info.libs[0])
        if self.settings.os in ("Linux", "FreeBSD"):
            self.cpp_info.system_libs = ["m"]
