#pragma once

// tinygltf as a parser only: it opens no files and decodes no images; both are ours, since what a
// model names must stay in its folder. Every user of the library includes this header, so that all
// see the same configuration; tiny_gltf.cpp holds the implementation.
#define TINYGLTF_NO_FS
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE

// With TINYGLTF_NO_FS its implementation forgets to include what its writers use.
#ifdef TINYGLTF_IMPLEMENTATION
#include <fstream>
#endif

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#include <tiny_gltf.h>
#pragma GCC diagnostic pop
