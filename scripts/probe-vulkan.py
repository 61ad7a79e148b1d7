#!/usr/bin/env python3
"""Is this machine's own Vulkan good enough, so that no lavapipe has to be fetched?

    probe-vulkan.py auto|lavapipe|NAME [--layer]

Prints one line and exits 0 (good, the line names the device) or 1 (not good, the line says why).
Good is: a hardware driver with Vulkan 1.1, or Mesa's lavapipe from 25 on (22.3 draws multiview wrongly).
`lavapipe` asks for the latter only, NAME for a device whose name contains it; --layer asks for Khronos' validation layer too.
It asks the loader itself, because manifests on the disk do not say whether a device is really there.
"""

import ctypes
import sys

VALIDATION = b"VK_LAYER_KHRONOS_validation"
CPU, HARDWARE = 4, (1, 2, 3)  # VkPhysicalDeviceType: integrated, discrete and virtual count as hardware
OLDEST_LAVAPIPE = 25


class InstanceInfo(ctypes.Structure):
    """VkInstanceCreateInfo."""

    _fields_ = [
        ("s_type", ctypes.c_uint32),
        ("next", ctypes.c_void_p),
        ("flags", ctypes.c_uint32),
        ("application", ctypes.c_void_p),
        ("layer_count", ctypes.c_uint32),
        ("layers", ctypes.c_void_p),
        ("extension_count", ctypes.c_uint32),
        ("extensions", ctypes.c_void_p),
    ]


class Properties(ctypes.Structure):
    """The head of VkPhysicalDeviceProperties; the rest (limits) is only room."""

    _fields_ = [
        ("api", ctypes.c_uint32),
        ("driver", ctypes.c_uint32),
        ("vendor", ctypes.c_uint32),
        ("device", ctypes.c_uint32),
        ("kind", ctypes.c_uint32),
        ("name", ctypes.c_char * 256),
        ("rest", ctypes.c_uint64 * 256),
    ]


def version(packed):
    return (packed >> 22 & 0x7F, packed >> 12 & 0x3FF, packed & 0xFFF)


def devices(vulkan):
    instance = ctypes.c_void_p()
    info = InstanceInfo(s_type=1)
    if vulkan.vkCreateInstance(ctypes.byref(info), None, ctypes.byref(instance)) != 0:
        return []
    count = ctypes.c_uint32()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None)
    handles = (ctypes.c_void_p * max(count.value, 1))()
    vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), handles)
    found = []
    for handle in handles[: count.value]:
        properties = Properties()
        vulkan.vkGetPhysicalDeviceProperties(ctypes.c_void_p(handle), ctypes.byref(properties))
        found.append(properties)
    return found


def has_validation_layer(vulkan):
    count = ctypes.c_uint32()
    vulkan.vkEnumerateInstanceLayerProperties(ctypes.byref(count), None)
    # VkLayerProperties: name[256], two u32, description[256].
    size = 256 + 4 + 4 + 256
    room = ctypes.create_string_buffer(size * max(count.value, 1))
    vulkan.vkEnumerateInstanceLayerProperties(ctypes.byref(count), room)
    names = (room.raw[i * size : i * size + 256].split(b"\0")[0] for i in range(count.value))
    return VALIDATION in names


def verdict(wanted, need_layer):
    try:
        vulkan = ctypes.CDLL("libvulkan.so.1")
    except OSError:
        return False, "no Vulkan loader (libvulkan.so.1)"
    found = devices(vulkan)
    if not found:
        return False, "its Vulkan loader finds no device"
    rejected = []
    for one in sorted(found, key=lambda one: one.kind == CPU):
        name, driver = one.name.decode(errors="replace"), version(one.driver)
        is_lavapipe = one.kind == CPU and name.startswith("llvmpipe")
        if wanted == "lavapipe":
            asked_for = is_lavapipe
        else:
            asked_for = wanted == "auto" or wanted.lower() in name.lower()
        if not asked_for:
            rejected.append(f"{name} is not what was asked for")
        elif is_lavapipe and driver[0] < OLDEST_LAVAPIPE:
            rejected.append(f"its lavapipe is older than Mesa {OLDEST_LAVAPIPE}")
        elif not is_lavapipe and one.kind not in HARDWARE:
            rejected.append(f"{name} is neither hardware nor lavapipe")
        elif version(one.api) < (1, 1, 0):
            rejected.append(f"{name} has only Vulkan 1.0")
        elif need_layer and not has_validation_layer(vulkan):
            return False, f"{name} is good, but Khronos' validation layer, which the tests run under, is missing"
        else:
            return True, name
    return False, "; ".join(rejected)


good, line = verdict(sys.argv[1], "--layer" in sys.argv[2:])
print(line)
sys.exit(0 if good else 1)
