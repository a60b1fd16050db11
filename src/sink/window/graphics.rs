//! Device and surface of the window. Picture and marks are drawn by one triangle.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bytemuck::{Pod, Zeroable};
use wgpu::CurrentSurfaceTexture as Acquired;
use winit::event_loop::OwnedDisplayHandle;
use winit::window::Window;

use super::marks::Placement;
use crate::sink::canvas::Canvas;

/// Uniforms of the shader, as `Placement` in window.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Uniforms {
    picture: [f32; 4],
    marks_scale: f32,
    surface_is_srgb: f32,
    brightness: f32,
    unused: f32,
}

/// Drawing parameters of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Drawing {
    pub(super) picture: Placement,
    /// Brightness of the picture; below 1 if it can't be trusted.
    pub(super) brightness: f32,
    pub(super) marks_scale: u32,
}

/// Outcome of drawing a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Drawn {
    /// The picture is on the screen, or the window can't be seen.
    Done,
    /// The surface was reconfigured, and the frame must be drawn again.
    Again,
    /// Surface or device is lost, and the graphics must be rebuilt.
    Lost,
}

/// A device with a window's surface.
pub(super) struct Graphics {
    surface: wgpu::Surface<'static>,
    device: wgpu::Device,
    queue: wgpu::Queue,
    configuration: wgpu::SurfaceConfiguration,
    pipeline: wgpu::RenderPipeline,
    sampler: wgpu::Sampler,
    uniforms: wgpu::Buffer,
    picture: wgpu::Texture,
    marks: wgpu::Texture,
    binding: wgpu::BindGroup,
    /// Buffer for the marks as RGBA.
    rgba: Vec<u8>,
    lost: Arc<AtomicBool>,
}

impl Graphics {
    /// Opens a device that can show `window`.
    pub(super) fn new(window: &Arc<Window>, display: OwnedDisplayHandle) -> Result<Self, String> {
        let mut descriptor = wgpu::InstanceDescriptor::new_with_display_handle(Box::new(display));
        descriptor.backends = wgpu::Backends::from_env().unwrap_or(wgpu::Backends::all());
        let instance = wgpu::Instance::new(descriptor);
        let surface = instance.create_surface(window.clone()).map_err(|e| e.to_string())?;
        let request = wgpu::RequestAdapterOptions { compatible_surface: Some(&surface), ..Default::default() };
        let adapter = pollster::block_on(instance.request_adapter(&request))
            .map_err(|e| format!("no graphics device can show a window here ({e})"))?;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("insonify window"),
            required_limits: wgpu::Limits::downlevel_defaults().using_resolution(adapter.limits()),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).map_err(|e| e.to_string())?;
        let lost = Arc::new(AtomicBool::new(false));
        let (by_callback, by_error) = (lost.clone(), lost.clone());
        device.set_device_lost_callback(move |_, reason| {
            tracing::warn!("the window's graphics device was lost: {reason}");
            by_callback.store(true, Ordering::Relaxed);
        });
        device.on_uncaptured_error(Arc::new(move |error| {
            tracing::warn!("the window's graphics device: {error}");
            by_error.store(true, Ordering::Relaxed);
        }));
        let size = window.inner_size();
        let mut configuration = surface
            .get_default_config(&adapter, size.width.max(1), size.height.max(1))
            .ok_or_else(|| format!("{} can't show this window", adapter.get_info().name))?;
        // Prefers a format that stores grey levels unchanged. For an sRGB format the shader converts them.
        let formats = surface.get_capabilities(&adapter).formats;
        let plain = formats.iter().find(|f| !f.is_srgb() && f.target_component_alignment() == Some(1));
        configuration.format = plain.copied().unwrap_or(configuration.format);
        configuration.desired_maximum_frame_latency = 1;
        surface.configure(&device, &configuration);

        let pipeline = pipeline(&device, configuration.format);
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let uniforms = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("placement"),
            size: size_of::<Uniforms>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let picture = texture(&device, 1, 1, wgpu::TextureFormat::R8Unorm);
        let marks = texture(&device, 1, 1, wgpu::TextureFormat::Rgba8Unorm);
        let binding = bind(&device, &pipeline, &uniforms, &picture, &marks, &sampler);
        let rgba = Vec::new();
        Ok(Self {
            surface,
            device,
            queue,
            configuration,
            pipeline,
            sampler,
            uniforms,
            picture,
            marks,
            binding,
            rgba,
            lost,
        })
    }

    /// Resizes the surface.
    pub(super) fn resize(&mut self, width: u32, height: u32) {
        let most = self.device.limits().max_texture_dimension_2d;
        (self.configuration.width, self.configuration.height) = (width.clamp(1, most), height.clamp(1, most));
        self.surface.configure(&self.device, &self.configuration);
    }

    /// Uploads grey levels [height × width].
    pub(super) fn set_picture(&mut self, width: u32, height: u32, image: &[u8]) {
        if (self.picture.width(), self.picture.height()) != (width, height) {
            self.picture = texture(&self.device, width, height, wgpu::TextureFormat::R8Unorm);
            self.bind();
        }
        self.upload(&self.picture, image, width);
    }

    /// Uploads the marks; black is transparent.
    pub(super) fn set_marks(&mut self, canvas: &Canvas) {
        let (width, height) = canvas.size();
        if (self.marks.width(), self.marks.height()) != (width, height) {
            self.marks = texture(&self.device, width, height, wgpu::TextureFormat::Rgba8Unorm);
            self.bind();
        }
        self.rgba.clear();
        let pixels = canvas.as_rgb().chunks_exact(3);
        self.rgba.extend(pixels.flat_map(|c| [c[0], c[1], c[2], if c == [0; 3] { 0 } else { 255 }]));
        self.upload(&self.marks, &self.rgba, 4 * width);
    }

    /// Draws picture and marks.
    pub(super) fn draw(&self, drawing: &Drawing) -> Drawn {
        let texture = match self.surface.get_current_texture() {
            _ if self.lost.load(Ordering::Relaxed) => return Drawn::Lost,
            Acquired::Success(texture) | Acquired::Suboptimal(texture) => texture,
            Acquired::Timeout | Acquired::Occluded => return Drawn::Done,
            Acquired::Outdated => {
                self.surface.configure(&self.device, &self.configuration);
                return Drawn::Again;
            }
            Acquired::Lost | Acquired::Validation => return Drawn::Lost,
        };
        let Placement { x, y, width, height } = drawing.picture;
        let uniforms = Uniforms {
            picture: [x, y, width, height].map(|v| v * drawing.marks_scale as f32),
            marks_scale: drawing.marks_scale as f32,
            surface_is_srgb: if self.configuration.format.is_srgb() { 1.0 } else { 0.0 },
            brightness: drawing.brightness,
            unused: 0.0,
        };
        self.queue.write_buffer(&self.uniforms, 0, bytemuck::bytes_of(&uniforms));
        let view = texture.texture.create_view(&wgpu::TextureViewDescriptor::default());
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("window"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.binding, &[]);
            pass.draw(0..3, 0..1);
        }
        self.queue.submit([encoder.finish()]);
        self.queue.present(texture);
        Drawn::Done
    }

    fn upload(&self, texture: &wgpu::Texture, bytes: &[u8], bytes_per_row: u32) {
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(bytes_per_row), rows_per_image: None };
        self.queue.write_texture(texture.as_image_copy(), bytes, layout, texture.size());
    }

    fn bind(&mut self) {
        let (picture, marks) = (&self.picture, &self.marks);
        self.binding = bind(&self.device, &self.pipeline, &self.uniforms, picture, marks, &self.sampler);
    }
}

fn texture(device: &wgpu::Device, width: u32, height: u32, format: wgpu::TextureFormat) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d { width: width.max(1), height: height.max(1), depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

fn bind(
    device: &wgpu::Device,
    pipeline: &wgpu::RenderPipeline,
    uniforms: &wgpu::Buffer,
    picture: &wgpu::Texture,
    marks: &wgpu::Texture,
    sampler: &wgpu::Sampler,
) -> wgpu::BindGroup {
    let [picture, marks] = [picture, marks].map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()));
    device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("window"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: uniforms.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::TextureView(&picture) },
            wgpu::BindGroupEntry { binding: 2, resource: wgpu::BindingResource::TextureView(&marks) },
            wgpu::BindGroupEntry { binding: 3, resource: wgpu::BindingResource::Sampler(sampler) },
        ],
    })
}

fn pipeline(device: &wgpu::Device, format: wgpu::TextureFormat) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("window"),
        source: wgpu::ShaderSource::Wgsl(include_str!("window.wgsl").into()),
    });
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("window"),
        // Derived from the shader's bindings.
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    })
}
