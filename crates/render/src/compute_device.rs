//! Devices that render frames or run generators, compared to tell whether their work competes.

/// PCI vendor ID of NVIDIA, whose GPUs alone run CUDA.
pub const NVIDIA: u32 = 0x10de;

/// Device on which a stage of the pipeline runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ComputeDevice {
    /// The CPU, for the host renderer and for software devices.
    Processors,
    /// A graphics device.
    Gpu {
        /// PCI vendor ID, if known.
        vendor: Option<u32>,
        /// Address on the PCI bus, if known.
        address: Option<PciAddress>,
    },
}

impl ComputeDevice {
    /// A graphics device with unknown vendor and address.
    pub const UNKNOWN_GPU: Self = Self::Gpu { vendor: None, address: None };

    /// Whether work on both devices slows each other down. Two GPUs count as one unless their known vendors or
    /// addresses differ.
    pub fn shares_with(self, other: Self) -> bool {
        let differ = |pair: (Option<u32>, Option<u32>)| matches!(pair, (Some(a), Some(b)) if a != b);
        match (self, other) {
            (Self::Processors, Self::Processors) => true,
            (Self::Gpu { vendor, address }, Self::Gpu { vendor: vendor_b, address: address_b }) => {
                let numbers = (address.map(PciAddress::number), address_b.map(PciAddress::number));
                !differ((vendor, vendor_b)) && !differ(numbers)
            }
            _ => false,
        }
    }
}

/// Address of a device on the PCI bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PciAddress {
    domain: u16,
    bus: u8,
    device: u8,
    function: u8,
}

impl PciAddress {
    /// Parses `domain:bus:device.function` in hexadecimal; `None` for any other text.
    pub fn parse(text: &str) -> Option<Self> {
        let (domain, rest) = text.trim().split_once(':')?;
        let (bus, rest) = rest.split_once(':')?;
        let (device, function) = rest.split_once('.')?;
        let byte = |text: &str| u8::from_str_radix(text, 16).ok();
        let domain = u16::try_from(u32::from_str_radix(domain, 16).ok()?).ok()?;
        Some(Self { domain, bus: byte(bus)?, device: byte(device)?, function: byte(function)? })
    }

    /// The address packed into 32 bits.
    fn number(self) -> u32 {
        u32::from(self.domain) << 16
            | u32::from(self.bus) << 8
            | u32::from(self.device & 31) << 3
            | u32::from(self.function & 7)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gpus_count_as_one_unless_they_are_known_to_differ() {
        let at = |vendor, text: &str| ComputeDevice::Gpu { vendor, address: PciAddress::parse(text) };
        let (nvidia, other) = (Some(NVIDIA), Some(0x1002));
        let cases = [
            (ComputeDevice::Processors, ComputeDevice::Processors, true),
            (ComputeDevice::Processors, ComputeDevice::UNKNOWN_GPU, false),
            (ComputeDevice::Processors, at(nvidia, "0000:01:00.0"), false),
            (ComputeDevice::UNKNOWN_GPU, ComputeDevice::UNKNOWN_GPU, true),
            (at(nvidia, ""), ComputeDevice::UNKNOWN_GPU, true),
            (at(nvidia, ""), at(nvidia, "0000:01:00.0"), true),
            (at(nvidia, "0000:01:00.0"), at(nvidia, "0000:01:00.0"), true),
            (at(nvidia, "0000:01:00.0"), at(nvidia, "0000:02:00.0"), false),
            (at(nvidia, "0000:01:00.0"), at(nvidia, "0001:01:00.0"), false),
            (at(other, ""), at(nvidia, ""), false),
            (at(other, "0000:01:00.0"), at(nvidia, ""), false),
        ];
        for (a, b, shared) in cases {
            assert_eq!((a.shares_with(b), b.shares_with(a)), (shared, shared), "{a:?} {b:?}");
        }
    }

    #[test]
    fn addresses_are_read_as_drivers_and_wgpu_write_them() {
        let address = PciAddress { domain: 0, bus: 0x1a, device: 0x1f, function: 0 };
        assert_eq!(PciAddress::parse("0000:1a:1f.0"), Some(address));
        // NVIDIA writes some domains with eight digits.
        assert_eq!(PciAddress::parse("00000000:1A:1F.0\n"), Some(address));
        for text in ["", "0000", "0000:1a", "0000:1a:1f", "0000:zz:00.0", "12345678:00:00.0", "0000:100:00.0"] {
            assert_eq!(PciAddress::parse(text), None, "{text}");
        }
    }
}
